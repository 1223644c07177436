#pragma once

#include <atomic>
#include <optional>

#include "core/pipeline/back_end.h"
#include "core/ring/latest.h"
#include "daemon/server/map_publisher.h"
#include "daemon/stages/channels.h"
#include "daemon/stages/latency.h"
#include "daemon/stages/step_timer.h"
#include "daemon/store/drive_journal.h"
#include "drivers/velodyne/counters.h"

namespace roadvec {

/// What the main thread wants to know of the back end, once a keyframe.
struct OptimiserReport {
  BackEndReport back_end;
  MapHead head;
  Pose2 T_map_odom;
};

/// Thread `rv-optimiser`: keyframes -> the map, which it owns, and its changes as frames in the log. An ordinary
/// thread.
class OptimiserStage {
 public:
  /// `journal`: for the store; none: nobody keeps the map.
  OptimiserStage(const PipelineConfig& config, KeyframeChannel& keyframes, Doorbell& bell, FrameLog& log, MapHead start,
                 Latencies& latencies, ChangeStamps& stamps, DriveJournal* journal = nullptr);

  /// Before run(): goes on with an earlier drive. `start` is its first guess.
  void recall(Recollection earlier);

  /// Until the keyframe channel is finished; then publishes the last of the map. Stop gives up waiting for slow
  /// readers.
  void run(const std::stop_token& stop);
  /// Any thread: let go of the map and begin another with the next keyframe, where the vehicle now is in the map.
  void begin_new_map() noexcept { new_map_wanted_.store(true, std::memory_order_relaxed); }

  [[nodiscard]] const StepTimer& timer() const { return timer_; }
  [[nodiscard]] Latest<OptimiserReport>& reports() { return reports_; }  ///< reader: main thread
  [[nodiscard]] const Counter& turns() const { return turns_; }
  [[nodiscard]] const Counter& keyframe_count() const { return taken_; }
  [[nodiscard]] const DurationHistogram& keyframe_times() const { return keyframe_times_; }
  [[nodiscard]] const Counter& misses() const { return misses_; }  ///< keyframes after which the next waited already
  [[nodiscard]] const BackEnd& back_end() const { return *back_end_; }  ///< after run()

 private:
  void forget_map(const std::stop_token& stop);
  void note();
  void take(const Keyframe& keyframe, const std::stop_token& stop);
  void publish(const MapChange& change, const std::stop_token& stop, std::int64_t received_ns = 0);

  KeyframeChannel& keyframes_;
  Doorbell& bell_;
  FrameLog& log_;
  DriveJournal* journal_;
  PipelineConfig config_;
  StepTimer timer_;
  std::optional<BackEnd> back_end_;
  std::uint64_t next_keyframe_ = 0;
  std::size_t noted_keyframe_count_ = 0, noted_loop_count_ = 0;  ///< in the journal
  bool has_noted_finding_ = false;
  SensorTime newest_;
  MapPublisher publisher_;
  Latest<OptimiserReport> reports_;
  Latencies& latencies_;
  ChangeStamps& stamps_;
  Counter turns_, taken_, misses_;
  DurationHistogram keyframe_times_;
  std::atomic<bool> new_map_wanted_{false};
};

}  // namespace roadvec
