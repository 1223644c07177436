#pragma once

#include <variant>

#include "core/base/time.h"

namespace roadvec {

/// Speeds of the four wheels over ground; a car that reports fewer repeats what it has.
struct WheelSpeed {
  double front_left_mps = 0, front_right_mps = 0, rear_left_mps = 0, rear_right_mps = 0;
};

/// Angle of the steering wheel, left positive.
struct SteeringAngle {
  double wheel_rad = 0;
};

/// Inertial sample, already turned into the `vehicle` frame (x ahead, y left, z up).
struct ImuSample {
  double rate_x_radps = 0, rate_y_radps = 0, rate_z_radps = 0;
  double acceleration_x_mps2 = 0, acceleration_y_mps2 = 0, acceleration_z_mps2 = 0;
  double roll_rad = 0, pitch_rad = 0;
  double heading_rad = 0;  ///< East-North-Up: 0 = east, counter-clockwise
  bool has_rate = false, has_acceleration = false, has_orientation = false;
};

struct MotionSample {
  SensorTime time;
  std::variant<WheelSpeed, SteeringAngle, ImuSample> value;
};

}  // namespace roadvec
