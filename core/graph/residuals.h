#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>

#include "core/base/angle.h"
#include "core/geometry/pose2.h"

namespace roadvec {

/// What a measured relative pose z (T_i_j) says of two poses x_i, x_j in the map frame [He2018, III-D]:
///
///   e(x_i, x_j) = ( R(theta_i)^T (t_j - t_i) - t_z,  theta_j - theta_i - theta_z ),   cost = |sqrt_information * e|^2
///
/// The angle is taken in [-pi, pi]. e is written in frame i, as the covariance of z is.
inline Eigen::Vector3d relative_pose_error(const Pose2& x_i, const Pose2& x_j, const Pose2& z) {
  const double c = std::cos(x_i.theta_rad), s = std::sin(x_i.theta_rad);
  const double dx = x_j.x_m - x_i.x_m, dy = x_j.y_m - x_i.y_m;
  return {c * dx + s * dy - z.x_m, -s * dx + c * dy - z.y_m, wrap_rad(x_j.theta_rad - x_i.theta_rad - z.theta_rad)};
}

/// The same as a Ceres cost with analytic derivatives; parameter blocks are (x, y, theta) of i and of j. The angle adds
/// up plainly and is wrapped in the error, so no manifold is needed.
///
///   de/dx_i = [ -R^T,  dR^T/dtheta (t_j - t_i) ]      de/dx_j = [ R^T,  0 ]
///             [   0,   -1                      ]                [  0,   1 ]
class RelativePoseCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  RelativePoseCost(const Pose2& z, const Eigen::Matrix3d& sqrt_information)
      : z_(z), sqrt_information_(sqrt_information) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const Pose2 x_i{parameters[0][0], parameters[0][1], parameters[0][2]};
    const Pose2 x_j{parameters[1][0], parameters[1][1], parameters[1][2]};
    Eigen::Map<Eigen::Vector3d>{residuals} = sqrt_information_ * relative_pose_error(x_i, x_j, z_);
    if (jacobians == nullptr) return true;
    const double c = std::cos(x_i.theta_rad), s = std::sin(x_i.theta_rad);
    const double dx = x_j.x_m - x_i.x_m, dy = x_j.y_m - x_i.y_m;
    if (jacobians[0] != nullptr) {
      Eigen::Matrix3d by_i;
      by_i << -c, -s, -s * dx + c * dy, s, -c, -c * dx - s * dy, 0, 0, -1;
      Eigen::Map<RowMajor>(jacobians[0], 3, 3) = sqrt_information_ * by_i;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Matrix3d by_j;
      by_j << c, s, 0, -s, c, 0, 0, 0, 1;
      Eigen::Map<RowMajor>(jacobians[1], 3, 3) = sqrt_information_ * by_j;
    }
    return true;
  }

 private:
  Pose2 z_;
  Eigen::Matrix3d sqrt_information_;
};

}  // namespace roadvec
