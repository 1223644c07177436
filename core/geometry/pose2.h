#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {

/// SE(2): x, y in metres, heading counter-clockwise from x in [-pi, pi]. `T_map_vehicle * p_vehicle` is `p_map`.
struct Pose2 {
  double x_m = 0, y_m = 0, theta_rad = 0;

  [[nodiscard]] Eigen::Vector2d translation() const { return {x_m, y_m}; }
  [[nodiscard]] Pose2 inverse() const {
    const double c = std::cos(theta_rad), s = std::sin(theta_rad);
    return {-c * x_m - s * y_m, s * x_m - c * y_m, -theta_rad};
  }
  friend Pose2 operator*(const Pose2& a, const Pose2& b) {
    const double c = std::cos(a.theta_rad), s = std::sin(a.theta_rad);
    return {a.x_m + c * b.x_m - s * b.y_m, a.y_m + s * b.x_m + c * b.y_m, wrap_rad(a.theta_rad + b.theta_rad)};
  }
  friend Eigen::Vector2d operator*(const Pose2& a, const Eigen::Vector2d& p) {
    const double c = std::cos(a.theta_rad), s = std::sin(a.theta_rad);
    return {a.x_m + c * p.x() - s * p.y(), a.y_m + s * p.x() + c * p.y()};
  }
  friend bool operator==(const Pose2&, const Pose2&) = default;
};

/// Covariance of (x, y, theta) of a pose, in the pose's parent frame: m^2, m rad, rad^2.
using PoseCovariance = Eigen::Matrix3d;

}  // namespace roadvec
