#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/base/angle.h"
#include "core/geometry/pose2.h"

namespace roadvec {

/// Small motions of SE(2) as vectors (x, y, theta). Those of one frame simply add up, and so do their covariances.

/// Adjoint: a small motion of the frame behind T, as a small motion of the frame before it.
inline Eigen::Matrix3d adjoint(const Pose2& T) {
  const double c = std::cos(T.theta_rad), s = std::sin(T.theta_rad);
  Eigen::Matrix3d A;
  A << c, -s, T.y_m, s, c, -T.x_m, 0, 0, 1;
  return A;
}

/// From a small motion of the parent frame to (x, y, theta) of a pose at `t` in it: turning the parent moves t
/// sideways.
inline Eigen::Matrix3d coordinates_at(const Eigen::Vector2d& t) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();
  M(0, 2) = -t.y();
  M(1, 2) = t.x();
  return M;
}

/// The motion at constant speed on a circle that begins as `twist` says and takes one unit of time.
inline Pose2 exp_of(const Eigen::Vector3d& twist) {
  const double theta = twist.z();
  // sin(theta) / theta and (1 - cos(theta)) / theta; below 1e-4 the next terms are rounding.
  const double a = std::abs(theta) < 1e-4 ? 1 - theta * theta / 6 : std::sin(theta) / theta;
  const double b = std::abs(theta) < 1e-4 ? theta / 2 : (1 - std::cos(theta)) / theta;
  return {a * twist.x() - b * twist.y(), b * twist.x() + a * twist.y(), wrap_rad(theta)};
}

/// Inverse of exp_of.
inline Eigen::Vector3d log_of(const Pose2& T) {
  const double half = T.theta_rad / 2;
  const double a = std::abs(half) < 1e-4 ? 1 - half * half / 3 : half / std::tan(half);
  return {a * T.x_m + half * T.y_m, -half * T.x_m + a * T.y_m, T.theta_rad};
}

}  // namespace roadvec
