#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/time.h"

namespace roadvec {

/// Takes "(seconds.fraction)" with one to nine decimals, and the blanks around it, off the front of a log line; exact,
/// where a double would round the nanoseconds of a date. Nothing, and the line untouched, when it begins otherwise.
[[nodiscard]] inline std::optional<SensorTime> take_log_stamp(std::string_view& line) noexcept {
  constexpr std::int64_t kLatest_s = 9'000'000'000;  // nanoseconds since 1970 still fit
  std::string_view rest = line;
  const auto take_digits = [&rest](std::int64_t& value) {
    int count = 0;
    for (; !rest.empty() && rest.front() >= '0' && rest.front() <= '9' && count < 11; ++count) {
      value = value * 10 + (rest.front() - '0');
      rest.remove_prefix(1);
    }
    return count;
  };
  const auto skip_blanks = [&rest] {
    while (!rest.empty() && (rest.front() == ' ' || rest.front() == '\t')) rest.remove_prefix(1);
  };
  const auto take = [&rest](char c) {
    if (rest.empty() || rest.front() != c) return false;
    rest.remove_prefix(1);
    return true;
  };
  std::int64_t seconds = 0;
  std::int64_t fraction = 0;
  skip_blanks();
  if (!take('(') || take_digits(seconds) == 0 || seconds > kLatest_s || !take('.')) return std::nullopt;
  const int decimals = take_digits(fraction);
  if (decimals == 0 || decimals > 9 || !take(')')) return std::nullopt;
  for (int i = decimals; i < 9; ++i) fraction *= 10;
  skip_blanks();
  line = rest;
  return SensorTime{seconds * 1'000'000'000 + fraction};
}

}  // namespace roadvec
