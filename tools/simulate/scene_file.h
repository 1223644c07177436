#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// A scene file that ships inside the program.
struct ShippedScene {
  std::string_view name;
  std::string_view text;
};

/// Generated from tools/simulate/scenes/*.toml when the program is built.
[[nodiscard]] std::span<const ShippedScene> shipped_scenes();

/// Reads a scene. `file` names the text in messages: "file:line: key: what is wrong".
[[nodiscard]] Expected<Scene> parse_scene(std::string_view text, const std::string& file);

/// The text of a shipped scene by its name, or of a scene file by its path.
[[nodiscard]] Expected<std::string> load_scene_text(const std::string& name_or_path);

/// The same, read.
[[nodiscard]] Expected<Scene> load_scene(const std::string& name_or_path);

}  // namespace roadvec
