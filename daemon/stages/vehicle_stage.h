#pragma once

#include <memory>
#include <vector>

#include "core/ring/latest.h"
#include "daemon/stages/channels.h"
#include "daemon/stages/last_heard.h"
#include "daemon/stages/motion_input.h"
#include "daemon/stages/step_timer.h"
#include "daemon/stages/wall_clock.h"
#include "drivers/velodyne/counters.h"

namespace roadvec {

/// Thread `rv-vehicle`: CAN and IMU -> motion samples, in one order of time.
///
/// Recorded inputs are merged by their stamps. Live ones are taken as they arrive: each is read for a moment in turn.
/// Live, what the wall clock was set by is taken out of the stamps, unless the LiDAR keeps UTC and they must too.
class VehicleStage {
 public:
  VehicleStage(std::vector<std::unique_ptr<MotionInput>> inputs, MotionChannel& motion, bool keeps_utc);

  /// Until all recordings are over or stop is asked for; then closes the channel.
  void run(const std::stop_token& stop) noexcept;

  [[nodiscard]] const Counter& sample_count() const { return samples_; }
  [[nodiscard]] const Counter& refused_count() const { return refused_; }  ///< the ring was full
  [[nodiscard]] const Counter& turns() const { return turns_; }
  [[nodiscard]] const DurationHistogram& turn_times() const { return turn_times_; }  ///< live
  [[nodiscard]] const Counter& misses() const { return misses_; }  ///< live: turns in which an input waited too long
  /// What came of one input, in the order of the constructor's.
  struct Activity {
    Counter samples;
    LastHeard last_sample;
  };
  [[nodiscard]] const Activity& activity(std::size_t input) const { return activity_[input]; }
  [[nodiscard]] Latest<VehicleCounts>& counts() { return counts_; }  ///< reader: main thread

 private:
  void merge(const std::stop_token& stop) noexcept;
  void follow(const std::stop_token& stop) noexcept;
  void drain(std::size_t i, const std::stop_token& stop) noexcept;
  void count_turn() noexcept;
  void publish_counts() noexcept;
  void hand_over(const MotionSample& sample, const std::stop_token& stop) noexcept;

  std::vector<std::unique_ptr<MotionInput>> inputs_;
  MotionChannel& motion_;
  const bool keeps_utc_;
  WallClock wall_clock_;
  std::vector<Activity> activity_;
  DurationHistogram turn_times_;
  Counter samples_, refused_, turns_, misses_;
  Latest<VehicleCounts> counts_;
};

}  // namespace roadvec
