#pragma once

#include <string>
#include <vector>

#include "daemon/config/fields.h"

namespace roadvec {

/// The settings as a TOML file, each key with range, default and meaning: `roadvecd --print-config`. Reads back as the
/// same settings. For `drive`, the keys of a drive.toml. Tables the settings lack are left out.
[[nodiscard]] std::string config_text(const Settings& settings, ConfigContext context = ConfigContext::car);

/// The text of config/roadvecd.toml: every key at its default; keys without one show an example and say so. It loads.
[[nodiscard]] std::string default_config_text();

/// A key whose value differs between two settings, each as the file would have it; empty: the table is not there.
struct KeyChange {
  std::string key, before, after;
};
[[nodiscard]] std::vector<KeyChange> changed_keys(const Settings& before, const Settings& after);

}  // namespace roadvec
