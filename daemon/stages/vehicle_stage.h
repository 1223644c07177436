#pragma once

#include <memory>
#include <vector>

#include "core/ring/latest.h"
#include "daemon/stages/channels.h"
#include "daemon/stages/motion_input.h"
#include "drivers/velodyne/counters.h"

namespace roadvec {

/// Thread `rv-vehicle`: CAN and IMU -> motion samples, in one order of time.
///
/// Recorded inputs are merged by their stamps. Live ones are taken as they arrive: each is read for a moment in turn.
class VehicleStage {
 public:
  VehicleStage(std::vector<std::unique_ptr<MotionInput>> inputs, MotionChannel& motion);

  /// Until all recordings are over or stop is asked for; then closes the channel.
  void run(const std::stop_token& stop) noexcept;

  [[nodiscard]] const Counter& sample_count() const { return samples_; }
  [[nodiscard]] const Counter& refused_count() const { return refused_; }  ///< the ring was full
  [[nodiscard]] const Counter& turns() const { return turns_; }
  [[nodiscard]] Latest<VehicleCounts>& counts() { return counts_; }  ///< reader: main thread

 private:
  void merge(const std::stop_token& stop) noexcept;
  void follow(const std::stop_token& stop) noexcept;
  void count_turn() noexcept;
  void publish_counts() noexcept;
  void hand_over(const MotionSample& sample, const std::stop_token& stop) noexcept;

  std::vector<std::unique_ptr<MotionInput>> inputs_;
  MotionChannel& motion_;
  Counter samples_, refused_, turns_;
  Latest<VehicleCounts> counts_;
};

}  // namespace roadvec
