#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <string_view>
#include <system_error>

namespace roadvec {

/// Reads a line from left to right; every take_ leaves the cursor where it was when it does not find what it wants.
class DbcCursor {
 public:
  explicit DbcCursor(std::string_view text) : rest_(text) {}

  [[nodiscard]] bool at_end() {
    skip_space();
    return rest_.empty();
  }
  [[nodiscard]] bool next_is(char c) {
    skip_space();
    return !rest_.empty() && rest_.front() == c;
  }
  bool take(char c) {
    if (!next_is(c)) return false;
    rest_.remove_prefix(1);
    return true;
  }
  /// Empty: the next character does not belong to a name.
  std::string_view take_name() {
    skip_space();
    const auto end = std::find_if_not(rest_.begin(), rest_.end(), is_name);
    const std::string_view name = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(name.size());
    return name;
  }
  template <class Number>
  bool take_number(Number& number) {
    skip_space();
    const char* first = rest_.data();
    if (!rest_.empty() && rest_.front() == '+') ++first;
    const auto [end, failed] = std::from_chars(first, rest_.data() + rest_.size(), number);
    if (failed != std::errc{}) return false;
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return true;
  }
  bool take_until(char c, std::string_view& before) {
    const std::size_t end = rest_.find(c);
    if (end == std::string_view::npos) return false;
    before = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    return true;
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v'; }
  static bool is_digit(char c) { return c >= '0' && c <= '9'; }
  // Bytes above ASCII are letters of cp1252 or UTF-8.
  static bool is_name(char c) {
    return is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
           static_cast<unsigned char>(c) >= 0x80;
  }
  void skip_space() {
    rest_.remove_prefix(
        static_cast<std::size_t>(std::find_if_not(rest_.begin(), rest_.end(), is_space) - rest_.begin()));
  }
  std::string_view rest_;
};

}  // namespace roadvec
