#pragma once

#include <compare>
#include <cstdint>

namespace roadvec {

/// Nanoseconds on one clock for all sensors of a drive: kernel receive time by default, the device clock when
/// configured.
struct SensorTime {
  std::int64_t ns = 0;

  friend constexpr auto operator<=>(SensorTime, SensorTime) = default;
  friend constexpr std::int64_t operator-(SensorTime a, SensorTime b) { return a.ns - b.ns; }
  friend constexpr SensorTime operator+(SensorTime a, std::int64_t b_ns) { return {a.ns + b_ns}; }
  friend constexpr SensorTime operator-(SensorTime a, std::int64_t b_ns) { return {a.ns - b_ns}; }
};

/// b to a in seconds.
[[nodiscard]] constexpr double seconds_between(SensorTime b, SensorTime a) {
  return static_cast<double>(a.ns - b.ns) * 1e-9;
}

}  // namespace roadvec
