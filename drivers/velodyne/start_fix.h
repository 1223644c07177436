#pragma once

#include <optional>

#include "drivers/velodyne/nmea.h"

namespace roadvec {

/// Where the vehicle is and how it stands, by GPS alone.
struct StartFix {
  double latitude_deg = 0, longitude_deg = 0;  ///< WGS 84
  std::optional<double> height_m;              ///< above the ellipsoid; RMC alone does not tell
  double yaw_deg = 0;                          ///< East-North-Up: 0 = east, counter-clockwise
};

/// Waits for a fix that also tells the heading: the course over ground of a vehicle that drives forward.
class StartFixFinder {
 public:
  /// Slower, a receiver's course is noise: 0.1 m/s of it turn 2 m/s by 3 degrees.
  static constexpr double kLeastSpeed_mps = 2.0;

  [[nodiscard]] std::optional<StartFix> add(const NmeaFix& fix) noexcept {
    if (!fix.valid) return std::nullopt;
    if (fix.height_m) height_m_ = fix.height_m;
    if (!fix.place || !fix.course_deg || fix.speed_mps.value_or(0) <= kLeastSpeed_mps) return std::nullopt;
    return StartFix{fix.place->latitude_deg, fix.place->longitude_deg, height_m_, 90.0 - *fix.course_deg};
  }

 private:
  std::optional<double> height_m_;
};

}  // namespace roadvec
