#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>

namespace roadvec {

/// Numbers as text: the same everywhere, whatever the locale.
[[nodiscard]] inline std::string decimal(double value, int digits) {
  char text[400];
  const std::to_chars_result end = std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, digits);
  std::string result(text, end.ptr);
  // -0.000 is not a different number.
  if (result.front() == '-' && result.find_first_of("123456789") == std::string::npos) result.erase(0, 1);
  return result;
}
/// Nanoseconds as seconds, exactly.
[[nodiscard]] inline std::string seconds_text(std::int64_t ns) {
  const std::uint64_t size = ns < 0 ? 0 - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
  std::string fraction = std::to_string(size % 1'000'000'000);
  fraction.insert(0, 9 - fraction.size(), '0');
  return (ns < 0 ? "-" : "") + std::to_string(size / 1'000'000'000) + "." + fraction;
}
/// A JSON string with its quotes. Bytes that JSON cannot hold as they are become \u00XX.
[[nodiscard]] inline std::string json_text(std::string_view text) {
  static constexpr char kHex[] = "0123456789abcdef";
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (byte < 0x20 || byte == 0x7F) {
      result += "\\u00";
      result += kHex[byte >> 4];
      result += kHex[byte & 0xF];
    } else {
      result += c;
    }
  }
  return result + "\"";
}

}  // namespace roadvec
