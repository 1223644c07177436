#include "tools/simulate/laser_beam.h"

namespace roadvec {
namespace {

constexpr double kNearX_m = 2.4, kNearY_m = 1.93;  ///< [VelodyneHDL64ES3, app. F]
constexpr double kFocalRange_m = 131.0;            ///< 65535 steps of 2 mm

}  // namespace

LaserOptics::LaserOptics(const LaserCalibration& laser)
    : laser_(laser),
      sin_rotation_(std::sin(laser.rotation_rad)),
      cos_rotation_(std::cos(laser.rotation_rad)),
      sin_elevation_(std::sin(laser.elevation_rad)),
      cos_elevation_(std::cos(laser.elevation_rad)),
      has_near_(laser.distance_x_m != 0 && laser.distance_y_m != 0),
      x_slope_((laser.distance_m - laser.distance_x_m) / (LaserBeam::kFar_m - kNearX_m)),
      y_slope_((laser.distance_m - laser.distance_y_m) / (LaserBeam::kFar_m - kNearY_m)) {
  near_x_m_ = laser.distance_x_m - x_slope_ * kNearX_m - laser.distance_m;
  near_y_m_ = laser.distance_y_m - y_slope_ * kNearY_m - laser.distance_m;
}

LaserBeam LaserOptics::far_beam(const HeadAzimuth& head) const {
  const double sin_a = head.sin * cos_rotation_ - head.cos * sin_rotation_;
  const double cos_a = head.cos * cos_rotation_ + head.sin * sin_rotation_;
  // x ahead, y left: the decoder's formula with the distance split off.
  return {
      .origin_m = {laser_.horizontal_offset_m * sin_a, laser_.horizontal_offset_m * cos_a, laser_.vertical_offset_m},
      .direction = {cos_elevation_ * cos_a, -cos_elevation_ * sin_a, sin_elevation_},
      .right = {-sin_a, -cos_a, 0},
      .up = {-sin_elevation_ * cos_a, sin_elevation_ * sin_a, cos_elevation_},
      .zero_m = laser_.distance_m};
}

/// The near corrections grow with |X| and |Y|, which grow with the distance R: each coordinate is linear in R, so the
/// points lie on a line again.
LaserBeam LaserOptics::near_beam(const HeadAzimuth& head) const {
  LaserBeam beam = far_beam(head);
  const double ahead = beam.direction.x(), right = -beam.direction.y();
  const double Dx_growth = x_slope_ * std::abs(right), Dy_growth = y_slope_ * std::abs(ahead);
  const Eigen::Vector3d along(ahead * (1 + Dy_growth), -right * (1 + Dx_growth),
                              sin_elevation_ * (1 + (Dx_growth + Dy_growth) / 2));
  beam.origin_m += Eigen::Vector3d(ahead * near_y_m_, -right * near_x_m_, sin_elevation_ * (near_x_m_ + near_y_m_) / 2);
  beam.stretch = along.norm();
  beam.direction = along * (1 / beam.stretch);
  return beam;
}

double LaserOptics::raw_intensity(double intensity, double raw_steps) const {
  if (laser_.focal_slope == 0) return intensity;
  const double focal = 1 - laser_.focal_distance_m / kFocalRange_m, here = 1 - raw_steps / 65535;
  return intensity - laser_.focal_slope * std::abs(256 * focal * focal - 256 * here * here);
}

}  // namespace roadvec
