#pragma once

#include <cmath>
#include <numbers>

namespace roadvec {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kTwoPi = 2.0 * std::numbers::pi;

[[nodiscard]] constexpr double rad_from_deg(double deg) { return deg * (kPi / 180.0); }
[[nodiscard]] constexpr double deg_from_rad(double rad) { return rad * (180.0 / kPi); }

/// The same angle in [-pi, pi].
[[nodiscard]] inline double wrap_rad(double angle_rad) { return std::remainder(angle_rad, kTwoPi); }

}  // namespace roadvec
