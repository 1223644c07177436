#include "drivers/imu/xsens.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

Eigen::Matrix3d rotation(double roll_rad, double pitch_rad, double yaw_rad) {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  return (AngleAxisd(yaw_rad, Vector3d::UnitZ()) * AngleAxisd(pitch_rad, Vector3d::UnitY()) *
          AngleAxisd(roll_rad, Vector3d::UnitX()))
      .toRotationMatrix();
}

/// Axes of the device's reference frame, as columns, in East-North-Up.
Eigen::Matrix3d R_enu_of(XsensFrame frame) {
  Eigen::Matrix3d R_enu_frame = Eigen::Matrix3d::Identity();
  if (frame == XsensFrame::north_east_down) R_enu_frame << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  if (frame == XsensFrame::north_west_up) R_enu_frame << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return R_enu_frame;
}

template <std::size_t N>
bool all_finite(const std::array<double, N>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

/// Sensor to reference frame; the quaternion is the finer of the two forms and has no singular pitch.
std::optional<Eigen::Matrix3d> R_frame_sensor_of(const XsensSample& sample) {
  if (sample.has_quaternion && all_finite(sample.quaternion)) {
    const Eigen::Quaterniond q(sample.quaternion[0], sample.quaternion[1], sample.quaternion[2], sample.quaternion[3]);
    // Fixed-point quaternions are off unit length by their rounding; anything farther off is no rotation.
    if (std::abs(q.squaredNorm() - 1.0) < 0.01) return q.normalized().toRotationMatrix();
  }
  if (!sample.has_euler || !all_finite(sample.euler_deg)) return std::nullopt;
  return rotation(rad_from_deg(sample.euler_deg[0]), rad_from_deg(sample.euler_deg[1]),
                  rad_from_deg(sample.euler_deg[2]));
}

}  // namespace

XsensToVehicle::XsensToVehicle(const Mounting& mounting)
    : R_vehicle_sensor_(rotation(mounting.roll_rad, mounting.pitch_rad, mounting.yaw_rad)) {}

std::optional<ImuSample> XsensToVehicle::convert(const XsensSample& sample) const noexcept {
  ImuSample imu;
  if (sample.has_rate && all_finite(sample.rate_radps)) {
    const Eigen::Vector3d rate_vehicle = R_vehicle_sensor_ * Eigen::Vector3d(sample.rate_radps.data());
    imu.rate_x_radps = rate_vehicle.x();
    imu.rate_y_radps = rate_vehicle.y();
    imu.rate_z_radps = rate_vehicle.z();
    imu.has_rate = true;
  }
  if (sample.has_acceleration && all_finite(sample.acceleration_mps2)) {
    const Eigen::Vector3d acceleration_vehicle = R_vehicle_sensor_ * Eigen::Vector3d(sample.acceleration_mps2.data());
    imu.acceleration_x_mps2 = acceleration_vehicle.x();
    imu.acceleration_y_mps2 = acceleration_vehicle.y();
    imu.acceleration_z_mps2 = acceleration_vehicle.z();
    imu.has_acceleration = true;
  }
  if (const std::optional<Eigen::Matrix3d> R_frame_sensor = R_frame_sensor_of(sample)) {
    const Eigen::Matrix3d R_enu_vehicle = R_enu_of(sample.frame) * *R_frame_sensor * R_vehicle_sensor_.transpose();
    imu.roll_rad = std::atan2(R_enu_vehicle(2, 1), R_enu_vehicle(2, 2));
    imu.pitch_rad = -std::asin(std::clamp(R_enu_vehicle(2, 0), -1.0, 1.0));
    imu.heading_rad = std::atan2(R_enu_vehicle(1, 0), R_enu_vehicle(0, 0));
    imu.has_orientation = true;
  }
  if (!imu.has_rate && !imu.has_acceleration && !imu.has_orientation) return std::nullopt;
  return imu;
}

SensorTime XsensClock::unwrap(std::uint32_t time_fine) noexcept {
  if (started_) {
    // As a signed step, so that a message out of order goes back a little and not ahead by 119 hours.
    ticks_ += static_cast<std::int32_t>(time_fine - last_);
  } else {
    ticks_ = time_fine;
  }
  last_ = time_fine;
  started_ = true;
  return SensorTime{ticks_ * 100'000};
}

bool XsensDecoder::next(ImuBytes& bytes, MotionSample& sample) noexcept {
  while (parser_.next(bytes.bytes, last_)) {
    const std::optional<ImuSample> imu = to_vehicle_.convert(last_);
    const SensorTime device_time = last_.has_time_fine ? clock_.unwrap(last_.time_fine) : SensorTime{};
    if (!imu) continue;
    if (!bytes.has_time && !last_.has_time_fine) {
      ++untimed_count_;
      continue;
    }
    sample.time = bytes.has_time ? bytes.time : device_time;
    sample.value = *imu;
    return true;
  }
  return false;
}

}  // namespace roadvec
