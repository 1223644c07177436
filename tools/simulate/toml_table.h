#pragma once

#include <toml++/toml.h>
#include <Eigen/Core>
#include <initializer_list>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace roadvec {

/// The first mistake found in a TOML file, as "file:line: key: what is wrong"; empty while there is none.
struct TomlProblem {
  std::string file;
  std::string message;
};

/// A TOML table read key by key. Each key's type and range are checked and a key nobody asked for is a mistake.
/// A key that is absent leaves the value as it is.
class TomlTable {
 public:
  TomlTable(const toml::table& table, std::string path, TomlProblem& problem)
      : table_(table), path_(std::move(path)), problem_(problem) {}

  void number(std::string_view key, double& value, double least, double most);
  void flag(std::string_view key, bool& value);
  void text(std::string_view key, std::string& value);
  /// One word of a list: value becomes its position.
  void word(std::string_view key, int& value, std::span<const std::string_view> words);
  void word(std::string_view key, int& value, std::initializer_list<std::string_view> words) {
    word(key, value, std::span(words.begin(), words.size()));
  }
  /// [[x, y, ...], ...]: rows of `least` to `most` numbers.
  void rows(std::string_view key, std::vector<std::vector<double>>& value, std::size_t least, std::size_t most);

  /// Calls read(TomlTable&) on the table, if there is one, and refuses the keys it left over.
  template <class Read>
  void table(std::string_view key, Read&& read) {
    if (const toml::node* node = find(key)) descend(*node, name(key), read);
  }
  /// The same on each table of an array of tables; a single table counts as an array of one.
  template <class Read>
  void tables(std::string_view key, Read&& read) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    if (node->is_table()) return descend(*node, name(key), read);
    if (!node->is_array()) return complain(node, key, "must be an array of tables, [[" + name(key) + "]]");
    for (const toml::node& item : *node->as_array()) descend(item, name(key), read);
  }

  [[nodiscard]] bool has(std::string_view key) const { return table_.contains(key); }
  void require(std::string_view key);
  void refuse_unknown_keys();
  void complain(std::string_view key, const std::string& what) { complain(table_.get(key), key, what); }

 private:
  [[nodiscard]] const toml::node* find(std::string_view key);
  [[nodiscard]] std::string name(std::string_view key) const;
  void complain(const toml::node* node, std::string_view key, const std::string& what);

  template <class Read>
  void descend(const toml::node& node, std::string path, Read&& read) {
    if (!node.is_table()) return complain(&node, path.substr(path.rfind('.') + 1), "must be a table");
    TomlTable child(*node.as_table(), std::move(path), problem_);
    read(child);
    child.refuse_unknown_keys();
  }

  const toml::table& table_;
  std::string path_;
  TomlProblem& problem_;
  std::set<std::string, std::less<>> asked_;
};

}  // namespace roadvec
