#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <memory>
#include <type_traits>

#include "core/sensor/motion.h"
#include "drivers/can/can_reader.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/imu/can_imu.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/imu/ncom.h"
#include "drivers/imu/xsens.h"

namespace roadvec {

/// What the vehicle thread's readers and decoders have counted.
struct VehicleCounts {
  CanCounters can, imu_can;
  MotionCounters motion, imu_motion;
  ImuCounters imu;
  XsensCounters xsens;
  NcomCounters ncom;
};

/// Messages of the IMU that were damaged or never came.
[[nodiscard]] inline std::uint64_t lost_of_imu(const VehicleCounts& counts) noexcept {
  return counts.imu.kernel_drop_count + counts.xsens.bad_checksum_count + counts.xsens.lost_message_count +
         counts.ncom.bad_checksum_count + counts.imu_can.kernel_drop_count;
}

/// One source of motion samples: a bus or an IMU, live or recorded.
class MotionInput {
 public:
  virtual ~MotionInput() = default;
  /// The oldest sample that was read and not taken, reading on for `timeout` at most if there is none; null: nothing
  /// came, or it is over. Valid until take().
  [[nodiscard]] virtual const MotionSample* front(std::chrono::milliseconds timeout) noexcept = 0;
  virtual void take() noexcept = 0;
  [[nodiscard]] virtual bool over() const noexcept = 0;
  /// Fills in its own part.
  virtual void count(VehicleCounts& counts) const noexcept = 0;
};

/// A bus whose frames a decoder turns into samples: MotionDecoder for the car, ImuCanDecoder for an inertial sensor.
template <class Decoder>
class CanInput final : public MotionInput {
 public:
  CanInput(std::unique_ptr<CanReader> reader, Decoder decoder)
      : reader_(std::move(reader)), decoder_(std::move(decoder)) {}
  const MotionSample* front(std::chrono::milliseconds timeout) noexcept override;
  void take() noexcept override { samples_ = samples_.subspan(1); }
  [[nodiscard]] bool over() const noexcept override { return over_ && samples_.empty(); }
  void count(VehicleCounts& counts) const noexcept override {
    constexpr bool of_car = std::is_same_v<Decoder, MotionDecoder>;
    (of_car ? counts.can : counts.imu_can) = reader_->counters();
    (of_car ? counts.motion : counts.imu_motion) = decoder_.counters();
  }

 private:
  std::unique_ptr<CanReader> reader_;
  Decoder decoder_;
  CanFrame frame_;
  std::span<const MotionSample> samples_;
  bool over_ = false;
};

/// A device whose bytes a decoder for its protocol turns into samples: XsensDecoder or NcomDecoder.
template <class Decoder>
class ImuInput final : public MotionInput {
 public:
  ImuInput(std::unique_ptr<ImuReader> reader, const Mounting& mounting)
      : reader_(std::move(reader)), decoder_(mounting) {}
  const MotionSample* front(std::chrono::milliseconds timeout) noexcept override;
  void take() noexcept override { has_sample_ = false; }
  [[nodiscard]] bool over() const noexcept override { return over_ && !has_sample_; }
  void count(VehicleCounts& counts) const noexcept override {
    counts.imu = reader_->counters();
    keep(decoder_.counters(), counts);
  }

 private:
  static void keep(const XsensCounters& from, VehicleCounts& counts) noexcept { counts.xsens = from; }
  static void keep(const NcomCounters& from, VehicleCounts& counts) noexcept { counts.ncom = from; }

  std::unique_ptr<ImuReader> reader_;
  Decoder decoder_;
  ImuBytes bytes_;
  MotionSample sample_;
  bool has_sample_ = false, over_ = false;
};

extern template class CanInput<MotionDecoder>;
extern template class CanInput<ImuCanDecoder>;
extern template class ImuInput<XsensDecoder>;
extern template class ImuInput<NcomDecoder>;

}  // namespace roadvec
