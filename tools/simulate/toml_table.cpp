#include "tools/simulate/toml_table.h"

#include <cmath>
#include <sstream>

namespace roadvec {
namespace {

std::string plain(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

}  // namespace

const toml::node* TomlTable::find(std::string_view key) {
  asked_.emplace(key);
  return table_.get(key);
}

std::string TomlTable::name(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

void TomlTable::complain(const toml::node* node, std::string_view key, const std::string& what) {
  if (!problem_.message.empty()) return;
  const auto line = (node != nullptr ? node->source() : table_.source()).begin.line;
  problem_.message = problem_.file + ":" + std::to_string(line) + ": " + name(key) + ": " + what;
}

void TomlTable::require(std::string_view key) {
  if (!has(key)) complain(nullptr, key, "is missing");
}

void TomlTable::number(std::string_view key, double& value, double least, double most) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const auto maybe_number = node->is_number() ? node->value<double>() : std::nullopt;
  if (!maybe_number || !std::isfinite(*maybe_number)) return complain(node, key, "must be a number");
  if (*maybe_number < least || *maybe_number > most) {
    return complain(node, key, plain(*maybe_number) + " is outside " + plain(least) + " to " + plain(most));
  }
  value = *maybe_number;
}

void TomlTable::flag(std::string_view key, bool& value) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  if (!node->is_boolean()) return complain(node, key, "must be true or false");
  value = node->as_boolean()->get();
}

void TomlTable::text(std::string_view key, std::string& value) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  if (!node->is_string()) return complain(node, key, "must be a text in quotes");
  value = node->as_string()->get();
}

void TomlTable::word(std::string_view key, int& value, std::span<const std::string_view> words) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const std::string given = node->value_or(std::string());
  std::string known;
  int position = 0;
  for (const std::string_view one : words) {
    if (given == one) {
      value = position;
      return;
    }
    known += (position++ == 0 ? "" : ", ") + std::string(one);
  }
  complain(node, key, "must be one of: " + known);
}

void TomlTable::rows(std::string_view key, std::vector<std::vector<double>>& value, std::size_t least,
                     std::size_t most) {
  const toml::node* node = find(key);
  if (node == nullptr) return;
  const std::string shape = "must be a list of [x, y" + std::string(most > 2 ? ", radius" : "") + "] in metres";
  if (!node->is_array()) return complain(node, key, shape);
  for (const toml::node& row : *node->as_array()) {
    const toml::array* numbers = row.as_array();
    if (numbers == nullptr || numbers->size() < least || numbers->size() > most) return complain(&row, key, shape);
    std::vector<double> row_m;
    for (const toml::node& number : *numbers) {
      const double metres = number.is_number() ? number.value_or(1e9) : 1e9;
      if (!(std::abs(metres) <= 1e5)) return complain(&number, key, "must hold numbers within 100 km of the origin");
      row_m.push_back(metres);
    }
    value.push_back(std::move(row_m));
  }
}

void TomlTable::refuse_unknown_keys() {
  for (const auto& [key, node] : table_) {
    if (!asked_.contains(key.str())) complain(&node, key.str(), "is not a key of this table");
  }
}

}  // namespace roadvec
