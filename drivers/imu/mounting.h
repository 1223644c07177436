#pragma once

#include <Eigen/Geometry>

namespace roadvec {

/// How a sensor is turned in the vehicle: R_vehicle_sensor = Rz(yaw) Ry(pitch) Rx(roll).
struct Mounting {
  double roll_rad = 0, pitch_rad = 0, yaw_rad = 0;
};

/// Rz(yaw) Ry(pitch) Rx(roll).
[[nodiscard]] inline Eigen::Matrix3d rotation_from(double roll_rad, double pitch_rad, double yaw_rad) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  return (AngleAxisd(yaw_rad, Vector3d::UnitZ()) * AngleAxisd(pitch_rad, Vector3d::UnitY()) *
          AngleAxisd(roll_rad, Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace roadvec
