#include "drivers/imu/xsens.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

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
  if (sample.has_matrix && all_finite(sample.matrix)) {
    // Sent column by column. [XsensMT0605P]
    const Eigen::Matrix3d R(sample.matrix.data());
    if ((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 0.01) return R;
  }
  if (!sample.has_euler || !all_finite(sample.euler_deg)) return std::nullopt;
  return rotation_from(rad_from_deg(sample.euler_deg[0]), rad_from_deg(sample.euler_deg[1]),
                       rad_from_deg(sample.euler_deg[2]));
}

/// Of a device that sends turns in place of rates. Nothing after a pause, over which the turns in between are lost.
std::optional<Eigen::Vector3d> mean_rate(const std::array<double, 4>& delta_q, std::int64_t step_ns) {
  constexpr std::int64_t kLongestStep_ns = 100'000'000;
  const Eigen::Quaterniond turn(delta_q[0], delta_q[1], delta_q[2], delta_q[3]);
  if (step_ns <= 0 || step_ns > kLongestStep_ns || !(std::abs(turn.squaredNorm() - 1.0) < 0.01)) return std::nullopt;
  const Eigen::AngleAxisd angle_axis(turn.normalized());
  return angle_axis.axis() * (wrap_rad(angle_axis.angle()) / (static_cast<double>(step_ns) * 1e-9));
}

}  // namespace

SensorAxesSample sensor_axes_of(const XsensSample& sample) noexcept {
  SensorAxesSample axes;
  if (sample.has_rate) {
    axes.rate_radps = Eigen::Vector3d(sample.rate_radps.data());
  } else if (sample.rate_hr_radps) {
    axes.rate_radps = Eigen::Vector3d(sample.rate_hr_radps->data());
  }
  if (sample.has_acceleration) {
    axes.acceleration_mps2 = Eigen::Vector3d(sample.acceleration_mps2.data());
  } else if (sample.acceleration_hr_mps2) {
    axes.acceleration_mps2 = Eigen::Vector3d(sample.acceleration_hr_mps2->data());
  }
  if (const std::optional<Eigen::Matrix3d> R_frame_sensor = R_frame_sensor_of(sample)) {
    axes.R_enu_sensor = R_enu_of(sample.frame) * *R_frame_sensor;
  }
  return axes;
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
    const SensorTime device_time = last_.has_time_fine ? clock_.unwrap(last_.time_fine) : SensorTime{};
    SensorAxesSample axes = sensor_axes_of(last_);
    if (last_.has_time_fine) {
      if (!axes.rate_radps && last_.delta_q && last_time_) {
        axes.rate_radps = mean_rate(*last_.delta_q, device_time - *last_time_);
      }
      last_time_ = device_time;
    }
    const std::optional<ImuSample> imu = to_vehicle_.convert(axes);
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
