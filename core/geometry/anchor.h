#pragma once

namespace roadvec {

/// Where on Earth (WGS 84) the origin of the `map` frame lies: East-North-Up here. Degrees, because it comes from
/// configuration and goes to people; GeographicLib takes them as they are.
struct Anchor {
  double latitude_deg = 0, longitude_deg = 0;
  double height_m = 0;  ///< above the ellipsoid
  double yaw_deg = 0;   ///< of the vehicle at the start fix: 0 = east, counter-clockwise

  friend bool operator==(const Anchor&, const Anchor&) = default;
};

}  // namespace roadvec
