#pragma once

#include <chrono>
#include <cstddef>
#include <vector>

#include "core/pipeline/front_end.h"
#include "core/ring/latest.h"
#include "daemon/server/pose_report.h"
#include "daemon/stages/channels.h"
#include "daemon/stages/last_heard.h"
#include "daemon/stages/latency.h"
#include "daemon/stages/step_timer.h"
#include "drivers/velodyne/counters.h"

namespace roadvec {

/// What the main thread wants to know of the front end, once a sweep.
struct MappingReport {
  FrontEndReport front_end;
  MotionSource speed_source = MotionSource::none, yaw_source = MotionSource::none;
  double gyro_bias_radps = 0, speed_scale = 0, steering_offset_rad = 0;
  MatchVerdict last_match = MatchVerdict::too_few_lines;
  std::optional<double> unobservable_rad;  ///< from straight ahead: along it the last match said nothing
  SensorTime time;
};

/// Thread `rv-mapping`: sweeps and motion -> keyframes, and the vehicle's pose in odom as often as motion comes in.
///
/// A sweep is mapped once the motion samples up to its end are there: with recorded input always, live for
/// kMotionPatience at most. What comes later than that is counted; the filter takes it as if it were new.
class MappingStage {
 public:
  MappingStage(const PipelineConfig& config, const FrontEndSetup& setup, SweepChannel& sweeps, MotionChannel& motion,
               Doorbell& bell, KeyframeChannel& keyframes, Latest<PoseReport>& poses, Latencies& latencies);

  /// Until both inputs are finished or stop is asked for; then closes the keyframe channel.
  void run(const std::stop_token& stop) noexcept;

  [[nodiscard]] const StepTimer& timer() const { return timer_; }
  [[nodiscard]] Latest<MappingReport>& reports() { return reports_; }  ///< reader: main thread
  [[nodiscard]] const Counter& late_motion_count() const { return late_; }
  [[nodiscard]] const Counter& turns() const { return turns_; }
  [[nodiscard]] const Counter& sweep_count() const { return mapped_; }
  [[nodiscard]] const DurationHistogram& sweep_times() const { return sweep_times_; }
  [[nodiscard]] const Counter& misses() const { return misses_; }  ///< sweeps that took longer than their revolution
  [[nodiscard]] const LastHeard& last_sweep() const { return last_sweep_; }

 private:
  using Clock = std::chrono::steady_clock;
  void drain_motion() noexcept;
  void forget_motion_before(SensorTime time) noexcept;
  void coast() noexcept;
  [[nodiscard]] bool motion_is_there(const Sweep& sweep) noexcept;
  void map_sweep(const Sweep& sweep, const std::stop_token& stop) noexcept;
  void report(const Sweep& sweep) noexcept;
  void publish_pose(const Odometry& odometry) noexcept;

  SweepChannel& sweeps_;
  MotionChannel& motion_;
  Doorbell& bell_;
  KeyframeChannel& keyframes_;
  Latest<PoseReport>& poses_;
  Latencies& latencies_;
  StepTimer timer_;
  FrontEnd front_end_;
  Odometry preview_;  ///< the filter of the last sweep, run on through what has come since: the pose at IMU rate
  std::vector<MotionSample> pending_;
  Latest<MappingReport> reports_;
  Counter late_, turns_, mapped_, misses_;
  DurationHistogram sweep_times_;
  LastHeard last_sweep_;
  SensorTime mapped_until_;
  const Sweep* waiting_for_ = nullptr;
  Clock::time_point waiting_since_;
};

}  // namespace roadvec
