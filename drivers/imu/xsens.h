#pragma once

#include <cstdint>
#include <optional>

#include "core/sensor/motion.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/imu/mtdata2.h"
#include "drivers/imu/vehicle_axes.h"

namespace roadvec {

/// What a message says about motion, in the sensor's axes. Orientation: from quaternion, matrix or angles, whichever
/// comes first, and East-North-Up whatever frame the device reports in. Pure.
[[nodiscard]] SensorAxesSample sensor_axes_of(const XsensSample& sample) noexcept;

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
  SensorToVehicle to_vehicle_;
  XsensClock clock_;
  XsensSample last_;
  std::optional<SensorTime> last_time_;  ///< by the device's clock
  std::uint64_t untimed_count_ = 0;
};

}  // namespace roadvec
