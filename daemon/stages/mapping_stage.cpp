#include "daemon/stages/mapping_stage.h"

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

constexpr std::chrono::milliseconds kMotionPatience{60};  // CAN's slowest wheel speeds come every 50 ms
// Live, CAN and IMU are read in turns of 4 ms: one may be that much ahead of the other.
constexpr std::int64_t kArrivalSlack_ns = 8'000'000;
constexpr std::size_t kPendingSamples = 8192;
constexpr std::int64_t kRunUp_ns = 5'000'000'000;  // motion before the first sweep that the filter starts on

}  // namespace

MappingStage::MappingStage(const PipelineConfig& config, const FrontEndSetup& setup, SweepChannel& sweeps,
                           MotionChannel& motion, Doorbell& bell, KeyframeChannel& keyframes, Latest<PoseReport>& poses,
                           Latencies& latencies)
    : sweeps_(sweeps),
      motion_(motion),
      bell_(bell),
      keyframes_(keyframes),
      poses_(poses),
      latencies_(latencies),
      front_end_(config, setup, timer_),
      preview_(config.odometry, setup.vehicle) {
  pending_.reserve(kPendingSamples);
  keyframes_.for_each_slot([](Keyframe& keyframe) {
    keyframe.lvm.reserve(4096, 512);
    keyframe.structure.reserve(4096, 512);
  });
}

void MappingStage::run(const std::stop_token& stop) noexcept {
  while (!stop.stop_requested()) {
    turns_.add();
    drain_motion();
    const Sweep* sweep = sweeps_.front();
    if (sweep != nullptr && mapped_.value() == 0) forget_motion_before(sweep->start - kRunUp_ns);
    if (sweep != nullptr && motion_is_there(*sweep)) {
      map_sweep(*sweep, stop);
      sweeps_.pop();
      waiting_for_ = nullptr;
    } else if (sweeps_.finished()) {
      break;
    } else {
      if (sweep == nullptr) coast();
      bell_.wait(kNap);
    }
  }
  keyframes_.close();
}

/// Everything that has come and fits. Once a sample beyond the waiting sweep is there the rest may wait in the ring.
void MappingStage::drain_motion() noexcept {
  const std::size_t before = pending_.size();
  while (pending_.size() < pending_.capacity()) {
    const MotionSample* sample = motion_.front();
    if (sample == nullptr) break;
    if (sample->time < mapped_until_) late_.add();
    pending_.push_back(*sample);
    motion_.pop();
  }
  if (pending_.size() == before || mapped_.value() == 0) return;
  const std::span<const MotionSample> fresh = std::span(pending_).subspan(before);
  preview_.integrate(fresh, preview_.time(), std::max(preview_.time(), fresh.back().time));
  publish_pose(preview_);
}

/// A CAN log may begin long before the first sweep: more than pending_ holds.
void MappingStage::forget_motion_before(SensorTime time) noexcept {
  const auto first = std::find_if(pending_.begin(), pending_.end(),
                                  [time](const MotionSample& sample) { return sample.time >= time; });
  pending_.erase(pending_.begin(), first);
}

/// Live, a LiDAR may be silent for longer than pending_ holds: the older half is driven without it, so that the
/// vehicle is where it is when sweeps come again. Those that are still under way are of the younger half.
void MappingStage::coast() noexcept {
  if (sweeps_.when_full() == WhenFull::wait || mapped_.value() == 0) return;
  if (pending_.size() < pending_.capacity() / 2) return;
  const auto half = static_cast<std::ptrdiff_t>(pending_.size() / 2);
  front_end_.coast(std::span(pending_).first(static_cast<std::size_t>(half)));
  pending_.erase(pending_.begin(), pending_.begin() + half);
}

bool MappingStage::motion_is_there(const Sweep& sweep) noexcept {
  const bool recorded = sweeps_.when_full() == WhenFull::wait;
  const std::int64_t slack_ns = recorded ? 0 : kArrivalSlack_ns;
  if (!pending_.empty() && pending_.back().time > sweep.end + slack_ns) return true;
  if (motion_.finished() || pending_.size() == pending_.capacity()) return true;
  if (recorded) return false;
  if (sweeps_.size() > 1) return true;  // behind: patience would cost the newest sweeps
  if (waiting_for_ != &sweep) {
    waiting_for_ = &sweep;
    waiting_since_ = Clock::now();
  }
  return Clock::now() - waiting_since_ > kMotionPatience;
}

void MappingStage::map_sweep(const Sweep& sweep, const std::stop_token& stop) noexcept {
  const Clock::time_point begin = Clock::now();
  const auto end = std::find_if(pending_.begin(), pending_.end(),
                                [&sweep](const MotionSample& sample) { return sample.time > sweep.end; });
  const auto count = static_cast<std::size_t>(end - pending_.begin());
  Keyframe* slot = keyframes_.claim(stop);
  if (front_end_.add(sweep, std::span(pending_).first(count), slot) != nullptr) keyframes_.publish();
  pending_.erase(pending_.begin(), end);
  mapped_until_ = sweep.end;
  mapped_.add();
  last_sweep_.note();
  latencies_.note(Station::mapped, sweep.received_ns);

  report(sweep);
  preview_ = front_end_.odometry();
  if (!pending_.empty()) preview_.integrate(pending_, preview_.time(), std::max(preview_.time(), pending_.back().time));
  publish_pose(preview_);
  const Clock::duration took = Clock::now() - begin;
  sweep_times_.add(took);
  if (sweep.complete && took.count() > sweep.end - sweep.start) misses_.add();
}

void MappingStage::report(const Sweep& sweep) noexcept {
  const Odometry& odometry = front_end_.odometry();
  const Match& match = front_end_.last_match();
  std::optional<double> unobservable_rad;
  if (match.usable() && match.unobservable) {
    // A direction, not a way: a quarter turn to either side of straight ahead.
    const double angle_rad = std::atan2(match.unobservable->y(), match.unobservable->x()) - odometry.pose().theta_rad;
    unobservable_rad = std::remainder(angle_rad, kPi);
  }
  reports_.store({front_end_.report(), odometry.speed_source(), odometry.yaw_source(), odometry.gyro_bias_radps(),
                  odometry.speed_scale(), odometry.steering_offset_rad(), match.verdict, unobservable_rad, sweep.end});
}

void MappingStage::publish_pose(const Odometry& odometry) noexcept {
  PoseReport report;
  report.time = odometry.time();
  report.T_odom_vehicle = odometry.pose();
  report.covariance = odometry.pose_covariance();
  report.speed_mps = odometry.speed_mps();
  report.yaw_rate_radps = odometry.yaw_rate_radps();
  poses_.store(report);
}

}  // namespace roadvec
