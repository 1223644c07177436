#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose2.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// The car at one instant: rear axle in the scene frame.
struct CarState {
  Pose2 pose;
  double speed_mps = 0, acceleration_mps2 = 0;
  double steering_rad = 0;  ///< of the front wheels of a single-track car, left positive
  double yaw_rate_radps = 0;
};

/// What the car truly does, once a millisecond: the kinematic single-track model, exact for a car whose rear wheels do
/// not slip.
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

/// Drives the car along its lane: it waits, speeds up, slows down before curves, stops, waits. The steering follows the
/// lane by pure pursuit [Coulter1992] behind a steering gear of limited speed, so the car cuts corners a little and its
/// steering never jumps.
[[nodiscard]] Expected<CarMotion> drive(const CarSpec& car, const RoadPath& path);

}  // namespace roadvec
