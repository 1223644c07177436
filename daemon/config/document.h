#pragma once

#include <toml++/toml.h>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/error.h"

namespace roadvec {

/// A parsed TOML text with what is found wrong in it, each finding tied to the line of its key.
class ConfigDocument {
 public:
  /// Syntax errors and double keys end here. `name` is said in errors.
  [[nodiscard]] static Expected<ConfigDocument> parse(std::string_view text, const std::string& name);

  [[nodiscard]] const toml::table& root() const { return root_; }
  /// The value under a dotted key; null if there is none.
  [[nodiscard]] const toml::node* find(std::string_view key) const;
  /// Notes "key 'x': what; remedy", on the line of `value` if given, else of the key, or of its table, or 1.
  void object(std::string_view key, const std::string& what_and_remedy, const toml::node* value = nullptr);
  [[nodiscard]] bool faultless() const { return problems_.empty(); }
  /// All that was noted, one line each, in the order of the text.
  [[nodiscard]] Error error() const;

 private:
  std::string name_;
  toml::table root_;
  std::vector<std::pair<unsigned, std::string>> problems_;
};

}  // namespace roadvec
