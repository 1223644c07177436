#pragma once

#include <Eigen/Core>
#include <cmath>

#include "drivers/velodyne/calibration.h"

namespace roadvec {

/// Where the head looks when a laser fires, clockwise from straight ahead.
struct HeadAzimuth {
  explicit HeadAzimuth(double azimuth_rad) : sin(std::sin(azimuth_rad)), cos(std::cos(azimuth_rad)) {}
  double sin, cos;
};

/// Where one laser's light goes at one azimuth: a straight line in the `lidar` frame, and what the packet says for a
/// range along it. The exact inverse of PacketDecoder's formula (decode.h).
struct LaserBeam {
  Eigen::Vector3d origin_m, direction;  ///< a unit vector
  Eigen::Vector3d right, up;            ///< across the beam
  double zero_m = 0, stretch = 1;       ///< raw distance 0 is zero_m before the origin, and how the line is stretched

  [[nodiscard]] double raw_m(double range_m) const {
    const double raw_m = range_m / stretch - zero_m;
    return raw_m < kFar_m ? raw_m : range_m - zero_m;
  }
  /// Range at which the line ends where another one takes over.
  [[nodiscard]] double near_end_m() const { return (kFar_m + zero_m) * stretch; }

  static constexpr double kFar_m = 25.04;  ///< where heads are calibrated [VelodyneHDL64ES3, app. F]
};

/// A laser as its calibration has it. Where that gives near corrections, raw distances below LaserBeam::kFar_m lie on a
/// line of their own, a little off the one beyond.
class LaserOptics {
 public:
  explicit LaserOptics(const LaserCalibration& laser);

  [[nodiscard]] bool has_near() const { return has_near_; }
  [[nodiscard]] LaserBeam far_beam(const HeadAzimuth& head) const;
  [[nodiscard]] LaserBeam near_beam(const HeadAzimuth& head) const;
  /// What the packet holds for an echo of this brightness, so that the decoder's correction gives it back.
  [[nodiscard]] double raw_intensity(double intensity, double raw_steps) const;

 private:
  LaserCalibration laser_;
  double sin_rotation_, cos_rotation_, sin_elevation_, cos_elevation_;
  bool has_near_ = false;
  double near_x_m_ = 0, near_y_m_ = 0;  ///< corrections of X and Y beyond that of the distance, where R = -D
  double x_slope_ = 0, y_slope_ = 0;    ///< by how much they grow with |X| and |Y|
};

}  // namespace roadvec
