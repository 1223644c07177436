#include "drivers/velodyne/calibration_text.h"

#include <charconv>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::optional<double> number_in(std::string_view text) {
  const std::string_view value = trimmed(text);
  double number = 0;
  const auto [end, code] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (code != std::errc() || end != value.data() + value.size() || !std::isfinite(number)) return std::nullopt;
  return number;
}

const char* implausible(const LaserCalibration& laser) noexcept {
  if (!(std::abs(laser.elevation_rad) <= kPi / 2 && std::abs(laser.rotation_rad) <= kTwoPi)) {
    return "an angle is out of range";
  }
  for (const double length_m :
       {laser.distance_m, laser.distance_x_m, laser.distance_y_m, laser.vertical_offset_m, laser.horizontal_offset_m}) {
    if (!(std::abs(length_m) <= 10.0)) return "a correction exceeds 10 m";
  }
  if (!(std::abs(laser.focal_distance_m) <= 1000.0 && std::abs(laser.focal_slope) <= 1000.0)) {
    return "the focal correction is out of range";
  }
  return nullptr;
}

}  // namespace roadvec
