#include "daemon/stages/optimiser_stage.h"

#include <chrono>
#include <thread>
#include <utility>

namespace roadvec {

OptimiserStage::OptimiserStage(const PipelineConfig& config, KeyframeChannel& keyframes, Doorbell& bell, FrameLog& log,
                               MapHead start, Latencies& latencies, ChangeStamps& stamps, DriveJournal* journal)
    : keyframes_(keyframes),
      bell_(bell),
      log_(log),
      journal_(journal),
      config_(config),
      publisher_(log, start),
      latencies_(latencies),
      stamps_(stamps) {
  back_end_.emplace(config_, start.T_map_odom, timer_);
}

void OptimiserStage::recall(Recollection earlier) {
  noted_keyframe_count_ = earlier.keyframes.size();
  noted_loop_count_ = earlier.graph.loops.size();
  back_end_->recall(std::move(earlier));
  reports_.store({back_end_->report(), publisher_.head(), back_end_->T_map_odom()});
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
    take(*keyframe, stop);
    if (keyframes_.front() != nullptr) misses_.add();
  }
  const MapChange& last = back_end_->finish();
  note();
  publish(last, stop);
}

void OptimiserStage::take(const Keyframe& keyframe, const std::stop_token& stop) {
  const auto begin = std::chrono::steady_clock::now();
  const std::int64_t received_ns = keyframe.received_ns;
  next_keyframe_ = keyframe.index + 1;
  newest_ = keyframe.time;
  const MapChange& change = back_end_->add(keyframe);
  keyframes_.pop();
  taken_.add();
  note();
  latencies_.note(Station::optimised, received_ns);
  const std::uint64_t before = publisher_.head().seq;
  publish(change, stop, received_ns);
  if (before < publisher_.head().seq) latencies_.note(Station::published, received_ns);
  keyframe_times_.add(std::chrono::steady_clock::now() - begin);
}

void OptimiserStage::forget_map(const std::stop_token& stop) {
  MapChange change;
  change.begins_anew = true;
  change.T_map_odom = back_end_->T_map_odom();
  change.time = newest_;
  for (const auto& [id, line] : back_end_->map()) change.removed.push_back(id);
  back_end_.emplace(config_, change.T_map_odom, timer_, next_keyframe_);
  noted_keyframe_count_ = noted_loop_count_ = 0;
  has_noted_finding_ = false;
  if (journal_ != nullptr) journal_->begin_new_map();
  publish(change, stop);
}

/// What the map is made of, for a later start.
void OptimiserStage::note() {
  if (journal_ == nullptr) return;
  const PoseGraph& graph = back_end_->graph();
  const BackEndReport& report = back_end_->report();
  JournalNews news;
  news.found_itself = report.recalled_keyframe_count > 0 && report.found_itself;
  news.recalled_all = news.found_itself && back_end_->has_recalled_all();
  // The drive has moved to where it is.
  if (news.found_itself && !has_noted_finding_) noted_keyframe_count_ = report.recalled_keyframe_count;
  has_noted_finding_ = news.found_itself;
  for (std::size_t& k = noted_keyframe_count_; k < graph.poses_map.size(); ++k) {
    news.keyframes.push_back({k, back_end_->keyframes()[k], k == 0 ? PoseEdge{} : graph.odometry[k - 1],
                              graph.travelled_m[k], graph.poses_map[k]});
  }
  for (; noted_loop_count_ < graph.loops.size(); ++noted_loop_count_) {
    news.loops.push_back(graph.loops[noted_loop_count_].edge);
  }
  journal_->note(std::move(news));
}

void OptimiserStage::publish(const MapChange& change, const std::stop_token& stop, std::int64_t received_ns) {
  std::uint64_t seq = publisher_.head().seq;
  publisher_.publish(change, back_end_->map(), [&](std::size_t bytes) {
    // Before the frame, which the server may have written before we go on.
    ++seq;
    if (ChangeStamp* const slot = received_ns != 0 ? stamps_.claim() : nullptr; slot != nullptr) {
      *slot = {seq, received_ns};
      stamps_.publish();
    }
    // The server's copy of the map and the store's must not miss a frame; clients have cursors. Both read in no time,
    // the store unless its disk hangs: the log holds minutes of the largest frames, hours of usual ones.
    while (!log_.has_room(bytes) && !stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  });
  reports_.store({back_end_->report(), publisher_.head(), back_end_->T_map_odom()});
}

}  // namespace roadvec
