#pragma once

#include "core/pipeline/back_end.h"
#include "core/ring/latest.h"
#include "daemon/server/map_publisher.h"
#include "daemon/stages/channels.h"
#include "daemon/stages/step_timer.h"
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
  OptimiserStage(const PipelineConfig& config, const Pose2& T_map_odom_start, KeyframeChannel& keyframes,
                 Doorbell& bell, FrameLog& log, MapHead start);

  /// Until the keyframe channel is finished; then publishes the last of the map. Stop gives up waiting for slow
  /// readers.
  void run(const std::stop_token& stop);

  [[nodiscard]] const StepTimer& timer() const { return timer_; }
  [[nodiscard]] Latest<OptimiserReport>& reports() { return reports_; }  ///< reader: main thread
  [[nodiscard]] const Counter& turns() const { return turns_; }
  [[nodiscard]] const Counter& keyframe_count() const { return taken_; }
  [[nodiscard]] const BackEnd& back_end() const { return back_end_; }  ///< after run()

 private:
  void publish(const MapChange& change, const std::stop_token& stop);

  KeyframeChannel& keyframes_;
  Doorbell& bell_;
  FrameLog& log_;
  StepTimer timer_;
  BackEnd back_end_;
  MapPublisher publisher_;
  Latest<OptimiserReport> reports_;
  Counter turns_, taken_;
};

}  // namespace roadvec
