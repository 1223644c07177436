#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "daemon/config/fields.h"

namespace roadvec {

/// The car's configuration. Unknown, double or missing keys, wrong types, values out of range and input files that are
/// not there are errors: one line each, "FILE:LINE: key 'x': what; remedy", all of a file together.
[[nodiscard]] Expected<Settings> load_settings(const std::filesystem::path& file);

/// A drive: the sensors of DIR/drive.toml, everything else from `overrides` (a configuration file whose sensor tables,
/// if it has any, are checked but not used) or the defaults.
[[nodiscard]] Expected<Settings> load_drive(const std::filesystem::path& dir,
                                            const std::optional<std::filesystem::path>& overrides = std::nullopt);

/// The same for text already in memory. `name` is said in errors, paths are resolved against `folder`, keys that the
/// text does not set keep their value in `base`. Any bytes will do: nothing is thrown.
[[nodiscard]] Expected<Settings> parse_settings(std::string_view text, const std::string& name,
                                                const std::filesystem::path& folder, ConfigContext context,
                                                Settings base = {});

}  // namespace roadvec
