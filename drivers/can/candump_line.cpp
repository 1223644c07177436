#include "drivers/can/candump_line.h"

#include <charconv>
#include <cstddef>
#include <optional>

#include "drivers/recording/log_stamp.h"

namespace roadvec {
namespace {

constexpr std::uint32_t kErrorFlag = 0x20000000;  // CAN_ERR_FLAG: candump writes it as part of the id

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Takes what stands before the next blank, and the blanks.
std::string_view take_word(std::string_view& text) {
  std::size_t end = 0;
  while (end < text.size() && !is_blank(text[end])) ++end;
  const std::string_view word = text.substr(0, end);
  text = trimmed(text.substr(end));
  return word;
}

int nibble(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

bool is_fd_length(std::size_t length) {
  return length <= 8 || length == 12 || length == 16 || length == 20 || length == 24 || length == 32 || length == 48 ||
         length == 64;
}

/// Three digits are a standard id, eight an extended one or the classes of an error frame.
bool read_id(std::string_view digits, CanFrame& frame) {
  if (digits.size() != 3 && digits.size() != 8) return false;
  std::uint32_t id = 0;
  for (const char c : digits) {
    const int value = nibble(c);
    if (value < 0) return false;
    id = id << 4 | static_cast<std::uint32_t>(value);
  }
  frame.error = digits.size() == 8 && (id & kErrorFlag) != 0;
  frame.extended = digits.size() == 8 && !frame.error;
  if (frame.error) id &= ~kErrorFlag;
  frame.id = id;
  return id <= (digits.size() == 8 ? kExtendedCanIdMask : kStandardCanIdMask);
}

/// Pairs of digits, set off by `separator` or not; false: something else, or more than a frame holds.
bool read_data(std::string_view digits, char separator, std::size_t max_bytes, CanFrame& frame) {
  std::size_t length = 0;
  while (!digits.empty()) {
    if (length > 0 && digits.front() == separator) digits.remove_prefix(1);
    const int high = !digits.empty() ? nibble(digits[0]) : -1;
    const int low = digits.size() > 1 ? nibble(digits[1]) : -1;
    if (high < 0 || low < 0 || length == max_bytes) return false;
    frame.data[length++] = static_cast<std::uint8_t>(high << 4 | low);
    digits.remove_prefix(2);
  }
  frame.length = static_cast<std::uint8_t>(length);
  return true;
}

/// "R", "R5": the length is that which was asked for.
bool read_remote(std::string_view text, CanFrame& frame) {
  frame.remote = true;
  if (text.size() > 1) frame.length = static_cast<std::uint8_t>(text[1] - '0');
  return text.size() == 1 || (text.size() == 2 && text[1] >= '0' && text[1] <= '8');
}

/// A classic frame of eight bytes may carry the length code it had on the bus, "_9" to "_F". It says nothing more.
std::string_view without_length_code(std::string_view data) {
  if (data.size() < 2 || data[data.size() - 2] != '_' || nibble(data.back()) < 9) return data;
  return data.substr(0, data.size() - 2);
}

/// "123#1122", "123##1112233", "123#R": the form of candump -l and -L. Returns why it is none, or nothing.
std::string_view read_compact(std::string_view text, CanFrame& frame) {
  const std::size_t hash = text.find('#');
  std::string_view data = text.substr(hash + 1);
  // CAN XL is "45123#81:00:12345678#11.22": priority and network, then flags, type and field.
  if (data.find(':') != std::string_view::npos) return "CAN XL is not supported";
  if (!read_id(text.substr(0, hash), frame)) return "the id is neither 3 nor 8 hexadecimal digits, or too large";
  if (data.starts_with('#')) {
    frame.fd = true;
    if (data.size() < 2 || nibble(data[1]) < 0) return "no CAN FD flags behind ##";
    if (!read_data(data.substr(2), '.', kMaxCanBytes, frame)) return "the data are not pairs of hexadecimal digits";
    return is_fd_length(frame.length) ? "" : "no CAN FD frame has this length";
  }
  if (data.starts_with('R')) return read_remote(data, frame) ? "" : "the remote frame's length is not 0 to 8";
  if (!read_data(without_length_code(data), '.', kMaxClassicCanBytes, frame)) {
    return "the data are not up to 8 pairs of hexadecimal digits";
  }
  return "";
}

/// "123   [8]  11 22 33": the console form. Two digits of length mean CAN FD.
std::string_view read_console(std::string_view text, CanFrame& frame) {
  std::string_view word = take_word(text);
  if (word == "RX" || word == "TX") {  // -x: direction, then bit rate switch and error state
    take_word(text);
    take_word(text);
    word = take_word(text);
  }
  if (!read_id(word, frame)) return "the id is neither 3 nor 8 hexadecimal digits, or too large";
  const std::string_view size = take_word(text);
  std::size_t length = 0;
  if (size.size() < 3 || size.front() != '[' || size.back() != ']') return "no [length] behind the id";
  const char* const last = size.data() + size.size() - 1;
  const auto [end, failed] = std::from_chars(size.data() + 1, last, length);
  frame.fd = size.size() == 4;
  if (failed != std::errc{} || end != last || size.size() > 4 ||
      length > (frame.fd ? kMaxCanBytes : kMaxClassicCanBytes) || !is_fd_length(length)) {
    return "no frame has this length";
  }
  frame.length = static_cast<std::uint8_t>(length);
  if (text.starts_with("remote request")) {
    frame.remote = true;
    return "";
  }
  const std::size_t digits = length == 0 ? 0 : 3 * length - 1;
  if (text.size() < digits) return "fewer data than [length]";
  const std::string_view behind = trimmed(text.substr(digits));
  // -a repeats the data as letters; error frames are named.
  if (!behind.empty() && behind.front() != '\'' && behind != "ERRORFRAME") return "more data than [length]";
  if (!read_data(text.substr(0, digits), ' ', kMaxCanBytes, frame) || frame.length != length) {
    return "the data are not pairs of hexadecimal digits";
  }
  return "";
}

std::uint64_t dropped_count(std::string_view text) {
  constexpr std::string_view kBefore = "dropped ";
  const std::size_t at = text.find(kBefore);
  std::uint64_t count = 1;
  if (at != std::string_view::npos)
    std::from_chars(text.data() + at + kBefore.size(), text.data() + text.size(), count);
  return count;
}

}  // namespace

CandumpLine parse_candump_line(std::string_view line) noexcept {
  CandumpLine result;
  std::string_view rest = trimmed(line);
  if (rest.empty()) {
    result.kind = CandumpKind::blank;
    return result;
  }
  if (rest.starts_with("DROPCOUNT")) {
    result.kind = CandumpKind::drops;
    result.dropped_count = dropped_count(rest);
    return result;
  }
  if (rest.front() == '(') {
    const std::optional<SensorTime> time = take_log_stamp(rest);
    if (!time) {
      result.reason = "the time is not (seconds.fraction): record with candump -L or -ta";
      return result;
    }
    result.frame.time = *time;
    result.has_time = true;
  }
  result.interface = take_word(rest);
  if (rest.empty()) {
    result.reason = "no frame behind the interface";
    return result;
  }
  // Only the compact form has a # in its first word; what follows it is the direction (-x).
  const std::string_view first_word = rest.substr(0, rest.find_first_of(" \t"));
  const bool compact = first_word.find('#') != std::string_view::npos;
  result.reason = compact ? read_compact(first_word, result.frame) : read_console(rest, result.frame);
  if (result.reason.empty()) result.kind = CandumpKind::frame;
  return result;
}

}  // namespace roadvec
