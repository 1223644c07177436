#pragma once

#include <string_view>
#include <vector>

#include "tools/simulate/scene.h"
#include "tools/simulate/toml_table.h"

namespace roadvec {

/// The scene's land, roads, everything along them, and what moves.
void read_world(TomlTable& top, Scene& scene);

/// [[x, y], [x, y, radius], ...]
[[nodiscard]] std::vector<Waypoint> read_waypoints(TomlTable& table, std::string_view key);

}  // namespace roadvec
