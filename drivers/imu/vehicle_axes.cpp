#include "drivers/imu/vehicle_axes.h"

#include <algorithm>
#include <cmath>

namespace roadvec {

std::optional<ImuSample> SensorToVehicle::convert(const SensorAxesSample& sample) const noexcept {
  ImuSample imu;
  if (sample.rate_radps && sample.rate_radps->allFinite()) {
    const Eigen::Vector3d rate_vehicle = R_vehicle_sensor_ * *sample.rate_radps;
    imu.rate_x_radps = rate_vehicle.x();
    imu.rate_y_radps = rate_vehicle.y();
    imu.rate_z_radps = rate_vehicle.z();
    imu.has_rate = true;
  }
  if (sample.acceleration_mps2 && sample.acceleration_mps2->allFinite()) {
    const Eigen::Vector3d acceleration_vehicle = R_vehicle_sensor_ * *sample.acceleration_mps2;
    imu.acceleration_x_mps2 = acceleration_vehicle.x();
    imu.acceleration_y_mps2 = acceleration_vehicle.y();
    imu.acceleration_z_mps2 = acceleration_vehicle.z();
    imu.has_acceleration = true;
  }
  if (sample.R_enu_sensor && sample.R_enu_sensor->allFinite()) {
    const Eigen::Matrix3d R_enu_vehicle = *sample.R_enu_sensor * R_vehicle_sensor_.transpose();
    imu.roll_rad = std::atan2(R_enu_vehicle(2, 1), R_enu_vehicle(2, 2));
    imu.pitch_rad = -std::asin(std::clamp(R_enu_vehicle(2, 0), -1.0, 1.0));
    imu.heading_rad = std::atan2(R_enu_vehicle(1, 0), R_enu_vehicle(0, 0));
    imu.has_orientation = true;
  }
  if (!imu.has_rate && !imu.has_acceleration && !imu.has_orientation) return std::nullopt;
  return imu;
}

}  // namespace roadvec
