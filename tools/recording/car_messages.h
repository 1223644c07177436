#pragma once

#include <array>
#include <string>

#include "core/base/time.h"

namespace roadvec {

/// The least steps that the car's messages can tell.
struct CarMessageSteps {
  double steering_deg = 0.1, wheel_speed_kmph = 0.01;
};

/// The car's messages: steering angle (Motorola, 100 Hz) and wheel speeds (Intel, 50 Hz).
[[nodiscard]] std::string vehicle_dbc(const CarMessageSteps& steps);

/// As candump -L writes them, without time and interface. `wheel_deg`: at the steering wheel, left positive.
[[nodiscard]] std::string steering_frame(const CarMessageSteps& steps, double wheel_deg, unsigned counter);
/// Speeds of front left, front right, rear left, rear right.
[[nodiscard]] std::string wheel_frame(const CarMessageSteps& steps, const std::array<double, 4>& speeds_mps);
/// The same for a car that does not slip: each wheel goes as fast as its own place on the car, the outer ones farther,
/// the front ones along the steered circle.
[[nodiscard]] std::array<double, 4> wheel_speeds_mps(double wheelbase_m, double track_m, double speed_mps,
                                                     double yaw_rate_radps);

/// "1767268800.001300": seconds with six decimals.
[[nodiscard]] std::string stamp(SensorTime time);

}  // namespace roadvec
