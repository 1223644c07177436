#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <memory>

#include "core/sensor/motion.h"
#include "drivers/can/can_reader.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/imu/xsens.h"

namespace roadvec {

/// What the vehicle thread's readers and decoders have counted.
struct VehicleCounts {
  CanCounters can;
  MotionCounters motion;
  ImuCounters imu;
  XsensCounters xsens;
};

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

class CanInput final : public MotionInput {
 public:
  CanInput(std::unique_ptr<CanReader> reader, MotionDecoder decoder)
      : reader_(std::move(reader)), decoder_(std::move(decoder)) {}
  const MotionSample* front(std::chrono::milliseconds timeout) noexcept override;
  void take() noexcept override { samples_ = samples_.subspan(1); }
  [[nodiscard]] bool over() const noexcept override { return over_ && samples_.empty(); }
  void count(VehicleCounts& counts) const noexcept override {
    counts.can = reader_->counters();
    counts.motion = decoder_.counters();
  }

 private:
  std::unique_ptr<CanReader> reader_;
  MotionDecoder decoder_;
  CanFrame frame_;
  std::span<const MotionSample> samples_;
  bool over_ = false;
};

class XsensInput final : public MotionInput {
 public:
  XsensInput(std::unique_ptr<ImuReader> reader, const Mounting& mounting)
      : reader_(std::move(reader)), decoder_(mounting) {}
  const MotionSample* front(std::chrono::milliseconds timeout) noexcept override;
  void take() noexcept override { has_sample_ = false; }
  [[nodiscard]] bool over() const noexcept override { return over_ && !has_sample_; }
  void count(VehicleCounts& counts) const noexcept override {
    counts.imu = reader_->counters();
    counts.xsens = decoder_.counters();
  }

 private:
  std::unique_ptr<ImuReader> reader_;
  XsensDecoder decoder_;
  ImuBytes bytes_;
  MotionSample sample_;
  bool has_sample_ = false, over_ = false;
};

}  // namespace roadvec
