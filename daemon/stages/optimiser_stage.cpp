#include "daemon/stages/optimiser_stage.h"

#include <thread>

namespace roadvec {

OptimiserStage::OptimiserStage(const PipelineConfig& config, const Pose2& T_map_odom_start, KeyframeChannel& keyframes,
                               Doorbell& bell, FrameLog& log, MapHead start)
    : keyframes_(keyframes), bell_(bell), log_(log), config_(config), publisher_(log, start) {
  back_end_.emplace(config_, T_map_odom_start, timer_);
}

void OptimiserStage::run(const std::stop_token& stop) {
  while (!keyframes_.finished()) {
    turns_.add();
    if (new_map_wanted_.exchange(false, std::memory_order_relaxed)) forget_map(stop);
    const Keyframe* keyframe = keyframes_.front();
    if (keyframe == nullptr) {
      bell_.wait(kNap);
      continue;
    }
    next_keyframe_ = keyframe->index + 1;
    newest_ = keyframe->time;
    const MapChange& change = back_end_->add(*keyframe);
    keyframes_.pop();
    taken_.add();
    publish(change, stop);
  }
  publish(back_end_->finish(), stop);
}

void OptimiserStage::forget_map(const std::stop_token& stop) {
  MapChange change;
  change.begins_anew = true;
  change.T_map_odom = back_end_->T_map_odom();
  change.time = newest_;
  for (const auto& [id, line] : back_end_->map()) change.removed.push_back(id);
  back_end_.emplace(config_, change.T_map_odom, timer_, next_keyframe_);
  publish(change, stop);
}

void OptimiserStage::publish(const MapChange& change, const std::stop_token& stop) {
  publisher_.publish(change, back_end_->map(), [&](std::size_t bytes) {
    // The server's copy of the map and the store's must not miss a frame; clients have cursors. Both read in no time,
    // the store unless its disk hangs: the log holds minutes of the largest frames, hours of usual ones.
    while (!log_.has_room(bytes) && !stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  });
  reports_.store({back_end_->report(), publisher_.head(), back_end_->T_map_odom()});
}

}  // namespace roadvec
