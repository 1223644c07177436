#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/sensor/motion.h"
#include "drivers/imu/mounting.h"

namespace roadvec {

/// What an inertial sensor says in its own axes; values that are no finite numbers count as missing.
struct SensorAxesSample {
  std::optional<Eigen::Vector3d> rate_radps, acceleration_mps2;
  std::optional<Eigen::Matrix3d> R_enu_sensor;
};

/// Turns a sample into the vehicle's axes: rates and accelerations are rotated; the orientation becomes roll, pitch and
/// heading of the vehicle, East-North-Up. Rates and accelerations stay those at the sensor's place. Pure.
class SensorToVehicle {
 public:
  explicit SensorToVehicle(const Mounting& mounting)
      : R_vehicle_sensor_(rotation_from(mounting.roll_rad, mounting.pitch_rad, mounting.yaw_rad)) {}
  /// Nothing when the sample holds nothing.
  [[nodiscard]] std::optional<ImuSample> convert(const SensorAxesSample& sample) const noexcept;

 private:
  Eigen::Matrix3d R_vehicle_sensor_;
};

}  // namespace roadvec
