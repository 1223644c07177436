#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/graph/close_loop.h"
#include "core/graph/find_itself.h"
#include "core/graph/keyframe_store.h"
#include "core/graph/optimise.h"
#include "core/graph/pose_graph.h"
#include "core/graph/recollection.h"
#include "core/map/concatenate.h"
#include "core/map/vector_map.h"
#include "core/pipeline/config.h"
#include "core/pipeline/keyframe.h"
#include "core/pipeline/report.h"

namespace roadvec {

struct TrajectoryPoint {
  SensorTime time;
  Pose2 T_map_vehicle;
};

struct BackEndReport {
  std::uint64_t keyframe_count = 0;
  CloseLoopReport loops;
  std::uint64_t optimise_count = 0, failed_optimise_count = 0;
  std::uint64_t solved_node_count = 0;         ///< poses that were solved for, all times together
  std::uint64_t loops_switched_off_count = 0;  ///< accepted, but contradicted by the rest of the graph at present
  std::uint64_t rederive_count = 0;            ///< how often what a closure moved was derived again
  std::uint64_t rederived_keyframe_count = 0;  ///< from how many keyframes, all times together
  std::uint64_t line_count = 0, vertex_count = 0;
  double map_length_m = 0;
  std::uint64_t recalled_keyframe_count = 0;  ///< of earlier drives
  bool found_itself = true;                   ///< in the map of earlier drives; always, where there are none
  double searched_m = 0;                      ///< path driven until it did, or until now
};

/// Steps 7 to 9 of the flowchart: keyframes in, the map and its changes out. Owns the map and `map <- odom`.
///
/// Ordinary thread: allocates. Same keyframes, same bytes. Between closures the work of add() does not grow with the
/// drive. With an earlier drive recalled, the map is at first of the new drive alone. Once loops tell where in the
/// earlier one the vehicle is, its lines come into the map, those around the vehicle first, some with each keyframe.
class BackEnd {
 public:
  /// `T_map_odom_start`: where the odometry's origin lies in the map, e.g. the anchor's heading; `probe` outlives this.
  /// `first_keyframe`: the index of the first that comes.
  BackEnd(const PipelineConfig& config, const Pose2& T_map_odom_start, StepProbe& probe,
          std::uint64_t first_keyframe = 0);

  /// An earlier drive, before the first keyframe. The first guess is where the map frame is put.
  void recall(Recollection recollection);

  /// Keyframes come in order. Valid until the next call.
  const MapChange& add(const Keyframe& keyframe);
  /// The drive is over: everything that hysteresis held back is published.
  const MapChange& finish();

  [[nodiscard]] const VectorMap& map() const { return concatenator_.map(); }
  [[nodiscard]] const Pose2& T_map_odom() const { return T_map_odom_; }
  /// Of all drives, also those recalled; one per pose of the graph.
  [[nodiscard]] std::span<const KeptKeyframe> keyframes() const { return keyframes_; }
  [[nodiscard]] const PoseGraph& graph() const { return graph_; }
  /// Found, and every line of the earlier drive is in the map again.
  [[nodiscard]] bool has_recalled_all() const { return report_.found_itself && to_recall_.empty(); }
  [[nodiscard]] std::span<const TrajectoryPoint> trajectory() const { return trajectory_; }
  /// Every loop that was accepted, also those that are switched off.
  [[nodiscard]] std::span<const LoopEdge> loops() const { return graph_.loops; }
  [[nodiscard]] const BackEndReport& report() const { return report_; }

 private:
  void take(const Keyframe& keyframe);
  [[nodiscard]] PoseEdge link_to(const Pose2& T_map_vehicle) const;
  void find_itself();
  void recall_lines(std::size_t most);
  void optimise_for(std::span<const PoseEdge> loops);
  void optimise(bool whole);
  [[nodiscard]] std::size_t first_to_move() const;
  void follow_poses(std::size_t first);
  [[nodiscard]] bool due_again() const;
  void rederive();
  void unpack(std::size_t keyframe);
  void concatenate(std::size_t keyframe);
  void count_changes();

  PipelineConfig config_;
  StepProbe& probe_;
  std::uint64_t first_keyframe_;
  LoopCloser loop_closer_;
  Optimiser optimiser_;
  Concatenator concatenator_;
  PoseGraph graph_;
  std::vector<KeptKeyframe> keyframes_;
  std::vector<std::optional<Pose2>> mapped_poses_;  ///< from where each keyframe's lines were put into the map, if ever
  std::size_t recalled_count_ = 0;                  ///< keyframes before it are of earlier drives
  std::optional<SelfFinder> self_finder_;           ///< until the vehicle has found itself
  std::vector<std::size_t> to_recall_;              ///< keyframes whose lines come into the map next, from the back
  std::vector<TrajectoryPoint> trajectory_;
  Pose2 T_map_odom_;
  double last_rederived_m_ = 0;                   ///< path travelled then
  double last_closure_m_ = 0, last_whole_m_ = 0;  ///< the same, when poses were last solved for; the whole path's
  double map_lag_m_ = 0;           ///< how far, at most, a keyframe's lines lie in the map from where its pose now is
  std::size_t first_lagging_ = 0;  ///< keyframes before it lie where their poses are
  bool unsolved_loops_ = false;
  LineSet lvm_;
  struct LineSize {
    std::uint64_t vertex_count = 0;
    double length_m = 0;
  };
  std::map<LineId, LineSize> line_sizes_;  ///< counted already, so that a change costs no walk over the map
  MapChange change_;
  BackEndReport report_;
};

}  // namespace roadvec
