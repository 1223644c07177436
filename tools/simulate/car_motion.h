#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose2.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// The car at one instant: its rear axle in the scene frame, its body on the springs.
struct CarState {
  Pose2 pose;                                   ///< seen from above
  double speed_mps = 0, acceleration_mps2 = 0;  ///< ahead, along the ground
  double side_speed_mps = 0;                    ///< of the rear axle to the left: it slips outwards in curves
  double side_acceleration_mps2 = 0;            ///< to the left, with what the curve takes
  double steering_rad = 0;                      ///< of the front wheels of a single-track car, left positive
  double yaw_rate_radps = 0;
  double z_m = 0, pitch_rad = 0, roll_rad = 0;  ///< R = Rz Ry Rx: nose down and left side up are positive
  double pitch_radps = 0, roll_radps = 0, z_mps2 = 0;

  [[nodiscard]] Eigen::Isometry3d T_scene_vehicle() const;
};

/// What the car truly does, once a millisecond.
class CarMotion {
 public:
  explicit CarMotion(std::vector<CarState> states) : states_(std::move(states)) {}

  [[nodiscard]] double duration_s() const { return static_cast<double>(states_.size() - 1) * kStep_s; }
  /// Between two states everything changes linearly. Times outside the drive give its ends.
  [[nodiscard]] CarState at(double time_s) const;

  static constexpr double kStep_s = 0.001;

 private:
  std::vector<CarState> states_;
};

/// Height of the ground under a wheel.
using GroundHeight = std::function<double(const Eigen::Vector2d&)>;

/// Drives the car along its lane: it waits, speeds up, slows down before curves, stops, waits; speed follows profiles
/// of limited acceleration and jerk. The steering follows the lane by pure pursuit [Coulter1992] behind a steering gear
/// of limited speed, so the car cuts corners a little and its steering never jumps.
///
/// The car is a single-track model with linear tyres in steady state [Rajamani2012, ch. 3]: curvature is
/// tan(steering) / (wheelbase + understeer v^2), and the rear axle slips by an angle that grows with the side
/// acceleration. The body stands on four springs: it follows the ground under the wheels, dives, squats and leans.
[[nodiscard]] Expected<CarMotion> drive(const CarSpec& car, const RoadPath& path, const GroundHeight& ground);

}  // namespace roadvec
