#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "core/sensor/motion.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/imu/mtdata2.h"

namespace roadvec {

/// How a sensor is turned in the vehicle: R_vehicle_sensor = Rz(yaw) Ry(pitch) Rx(roll).
struct Mounting {
  double roll_rad = 0, pitch_rad = 0, yaw_rad = 0;
};

/// Turns what the device says into the vehicle's axes: rates and accelerations are rotated; the orientation becomes
/// roll, pitch and heading of the vehicle, East-North-Up whatever frame the device reports in. Rates and accelerations
/// stay those at the sensor's place. Pure.
class XsensToVehicle {
 public:
  explicit XsensToVehicle(const Mounting& mounting);
  /// Nothing when the message holds neither rate nor acceleration nor orientation, or none that is a finite number.
  [[nodiscard]] std::optional<ImuSample> convert(const XsensSample& sample) const noexcept;

 private:
  Eigen::Matrix3d R_vehicle_sensor_;
};

/// Device time without end: SampleTimeFine counts 100 us and wraps after 119 hours.
class XsensClock {
 public:
  [[nodiscard]] SensorTime unwrap(std::uint32_t time_fine) noexcept;

 private:
  std::uint32_t last_ = 0;
  std::int64_t ticks_ = 0;
  bool started_ = false;
};

/// From the bytes of an ImuReader to motion samples. Time: that of the piece of bytes that completes the message, or
/// the device's own where the reader knows none (ImuBytes::has_time). No allocation.
class XsensDecoder {
 public:
  explicit XsensDecoder(const Mounting& mounting) : to_vehicle_(mounting) {}

  /// Takes bytes off the front of `bytes` up to the next sample; false when they are used up. Call until then.
  [[nodiscard]] bool next(ImuBytes& bytes, MotionSample& sample) noexcept;

  [[nodiscard]] const XsensCounters& counters() const noexcept { return parser_.counters(); }
  [[nodiscard]] const XsensSample& last() const noexcept { return last_; }               ///< what the device said last
  [[nodiscard]] std::uint64_t untimed_count() const noexcept { return untimed_count_; }  ///< without any time; dropped

 private:
  Mtdata2Parser parser_;
  XsensToVehicle to_vehicle_;
  XsensClock clock_;
  XsensSample last_;
  std::uint64_t untimed_count_ = 0;
};

}  // namespace roadvec
