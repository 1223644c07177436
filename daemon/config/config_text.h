#pragma once

#include <string>

#include "daemon/config/fields.h"

namespace roadvec {

/// The settings as a TOML file, each key with range, default and meaning: `roadvecd --print-config`. Reads back as the
/// same settings. For `drive`, the keys of a drive.toml. Tables the settings lack are left out.
[[nodiscard]] std::string config_text(const Settings& settings, ConfigContext context = ConfigContext::car);

/// The text of config/roadvecd.toml: every key at its default; keys without one show an example and say so. It loads.
[[nodiscard]] std::string default_config_text();

}  // namespace roadvec
