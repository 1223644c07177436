#include "drivers/can/asc_line.h"

#include <linux/can/error.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <optional>

namespace roadvec {
namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr std::int64_t kLongest_ns = 3'000'000'000'000'000'000;  // of a log whose times are added up: 95 years

/// Takes the first word; "": there is none.
std::string_view next_word(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

template <class Number>
bool read_number(std::string_view word, Number& number, int base = 10) {
  const auto [end, failed] = std::from_chars(word.data(), word.data() + word.size(), number, base);
  return failed == std::errc{} && end == word.data() + word.size();
}

/// "12.345678", exactly.
std::optional<std::int64_t> nanoseconds_of(std::string_view word) {
  constexpr std::uint32_t kLatest_s = 2'000'000'000;  // with any date before 2100 the sum still fits
  const std::size_t point = word.find('.');
  std::string_view decimals = point == std::string_view::npos ? "0" : word.substr(point + 1);
  std::uint32_t seconds = 0;
  std::uint32_t fraction = 0;
  if (!read_number(word.substr(0, point), seconds) || seconds > kLatest_s) return std::nullopt;
  if (decimals.size() > 9 || !read_number(decimals, fraction)) return std::nullopt;
  std::int64_t nanoseconds = fraction;
  for (std::size_t i = decimals.size(); i < 9; ++i) nanoseconds *= 10;
  return std::int64_t{seconds} * 1'000'000'000 + nanoseconds;
}

/// 1 to 12 in English or German; 0: another language.
unsigned month_of(std::string_view word) {
  constexpr std::array<std::string_view, 17> kNames = {"Jan", "Feb",        "Mar", "Apr", "May", "Jun",
                                                       "Jul", "Aug",        "Sep", "Oct", "Nov", "Dec",
                                                       "Mrz", "M\xC3\xA4r", "Mai", "Okt", "Dez"};
  constexpr std::array<unsigned, 17> kMonths = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 3, 3, 5, 10, 12};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (word.starts_with(kNames[i])) return kMonths[i];
  }
  return 0;
}

/// "15:06:13.191" and "pm" or "am", which may be missing.
std::optional<std::int64_t> time_of_day_ns(std::string_view word, std::string_view half) {
  unsigned hours = 0;
  unsigned minutes = 0;
  if (word.size() < 8 || word[2] != ':' || word[5] != ':') return std::nullopt;
  if (!read_number(word.substr(0, 2), hours) || !read_number(word.substr(3, 2), minutes)) return std::nullopt;
  const std::optional<std::int64_t> seconds_ns = nanoseconds_of(word.substr(6));
  if (!seconds_ns || hours > 24 || minutes > 59) return std::nullopt;
  if (!half.empty()) hours = hours % 12 + (half == "pm" || half == "PM" ? 12 : 0);
  return *seconds_ns + (hours * 60 + minutes) * 60'000'000'000LL;
}

/// `count` numbers; false: fewer, or one that is no byte.
bool read_data(std::string_view& words, std::size_t count, int base, CanFrame& frame) {
  for (std::size_t i = 0; i < count; ++i) {
    if (!read_number(next_word(words), frame.data[i], base)) return false;
  }
  frame.length = static_cast<std::uint8_t>(count);
  return true;
}

void make_error(CandumpLine& line) {
  line.frame.error = true;
  line.frame.id = CAN_ERR_BUSERROR;  // ASC does not say of which kind
  line.kind = CandumpKind::frame;
}

bool is_direction(std::string_view word) { return word == "Rx" || word == "Tx"; }

}  // namespace

bool AscLines::is_header(std::string_view line) noexcept {
  const std::string_view word = next_word(line);
  return word == "date" || word == "base" || word == "internal" || word == "no" || word == "//" || word == "Begin";
}

bool AscLines::read_header(std::string_view line) noexcept {
  std::string_view words = line;
  const std::string_view first = next_word(words);
  if (first == "date") {
    read_date(words);
  } else if (first == "base") {
    base_ = next_word(words) == "dec" ? 10 : 16;
    next_word(words);
    relative_ = next_word(words) == "relative";
  }
  return is_header(line) || first == "End" || first.starts_with("//");
}

/// "Wed Sep 30 15:06:13.191 2020", "Mit Sep 30 03:06:13.191 pm 2020"
void AscLines::read_date(std::string_view words) noexcept {
  next_word(words);
  const unsigned month = month_of(next_word(words));
  unsigned day = 0;
  int year = 0;
  const std::string_view day_word = next_word(words);
  const std::string_view time = next_word(words);
  std::string_view half = next_word(words);
  std::string_view year_word = next_word(words);
  if (year_word.empty()) std::swap(half, year_word);
  const std::optional<std::int64_t> time_ns = time_of_day_ns(time, half);
  if (month == 0 || !read_number(day_word, day) || !read_number(year_word, year) || !time_ns) return;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month), std::chrono::day(day)};
  if (!date.ok() || year < 1970 || year > 2100) return;
  date_ns_ = std::chrono::nanoseconds(std::chrono::sys_days(date).time_since_epoch()).count() + *time_ns;
}

/// "1F334455x" is an extended id, "123" a standard one.
bool AscLines::read_id(std::string_view word, CanFrame& frame) const noexcept {
  frame.extended = word.ends_with('x');
  if (frame.extended) word.remove_suffix(1);
  return read_number(word, frame.id, base_) && frame.id <= (frame.extended ? kExtendedCanIdMask : kStandardCanIdMask);
}

/// "123 Rx d 2 11 22 ...", "123x Tx r", "ErrorFrame"
std::string_view AscLines::read_classic(std::string_view words, CandumpLine& line) const noexcept {
  const std::string_view first = next_word(words);
  if (first == "ErrorFrame") {
    make_error(line);
    return "";
  }
  const std::string_view direction = next_word(words);
  if (!is_direction(direction)) return "";  // statistics, requests to send
  if (!read_id(first, line.frame)) return "the id is no number, or too large";
  const std::string_view kind = next_word(words);
  const std::string_view length_word = next_word(words);
  std::size_t length = 0;
  const bool has_length = read_number(length_word, length, 16) && length <= 15;
  length = std::min(length, kMaxClassicCanBytes);  // codes 9 to 15 stand for eight bytes
  if (kind == "r") {
    line.frame.remote = true;
    line.frame.length = static_cast<std::uint8_t>(has_length ? length : 0);
  } else if (kind != "d" || !has_length || !read_data(words, length, base_, line.frame)) {
    return "not 'd', a length of 0 to 8 and as many bytes";
  }
  line.kind = CandumpKind::frame;
  return "";
}

/// "1 Rx 123 [name] brs esi dlc length data ..."
std::string_view AscLines::read_fd(std::string_view words, CandumpLine& line) const noexcept {
  line.interface = next_word(words);
  if (!is_direction(next_word(words))) return "";
  const std::string_view id = next_word(words);
  if (id == "ErrorFrame") {
    make_error(line);
    return "";
  }
  if (!read_id(id, line.frame)) return "the id is no number, or too large";
  std::string_view bit_rate_switch = next_word(words);
  if (bit_rate_switch != "0" && bit_rate_switch != "1") bit_rate_switch = next_word(words);  // that was the name
  next_word(words);                                                                          // error state
  next_word(words);                                                                          // length code
  std::size_t length = 0;
  line.frame.fd = true;
  const bool read = (bit_rate_switch == "0" || bit_rate_switch == "1") && read_number(next_word(words), length) &&
                    length <= kMaxCanBytes && read_data(words, length, 16, line.frame);
  if (!read) return "not brs, esi, dlc, a length of 0 to 64 and as many bytes";
  line.kind = CandumpKind::frame;
  return "";
}

CandumpLine AscLines::parse(std::string_view line) noexcept {
  CandumpLine result;
  result.kind = CandumpKind::blank;
  std::string_view words = line;
  const std::string_view first = next_word(words);
  if (first.empty() || read_header(line)) return result;
  const std::optional<std::int64_t> time_ns = nanoseconds_of(first);
  if (!time_ns) {
    result.kind = CandumpKind::bad;
    result.reason = "neither a time nor the head of a log";
    return result;
  }
  last_ns_ = relative_ ? std::min(last_ns_, kLongest_ns) + *time_ns : *time_ns;
  result.frame.time = {date_ns_ + last_ns_};
  result.has_time = true;
  const std::string_view second = next_word(words);
  unsigned channel = 0;
  if (second == "CANFD") {
    result.reason = read_fd(words, result);
  } else if (read_number(second, channel)) {
    result.interface = second;
    result.reason = read_classic(words, result);
  }
  if (!result.reason.empty()) result.kind = CandumpKind::bad;
  return result;
}

}  // namespace roadvec
