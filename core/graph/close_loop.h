#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/graph/keyframe_store.h"
#include "core/graph/pose_graph.h"
#include "core/map/match.h"

namespace roadvec {

struct CloseLoopConfig {
  double min_gap_m = 50.0;  ///< choice: beyond the view of one keyframe, so that a place is left before it is revisited
  double every_m = 2.0;     ///< choice: bounds the work per metre
  double sure_every_m = 4.0;     ///< choice: neighbouring keyframes share most of their lines; more would repeat them
  double radius_m = 10.0;        ///< choice: local maps 80 m long still overlap by more than half
  double max_radius_m = 40.0;    ///< choice: beyond it, half a local map, nothing can overlap
  double neighbourhood_m = 8.0;  ///< choice: closes the gaps of single local maps
  double start_spacing_m = 1.5;  ///< the matcher finds the way from 2 m off (match.first_gate_m)
  int max_starts_per_side = 4;   ///< choice: 9 x 9 starts at most
  double min_overlap = 0.5;      ///< choice; KISS-SLAM asks for 0.4 of point clouds
  double max_rms_m = 0.10;       ///< choice: matching error that still closes a loop [He2018, III-D]
  double distinct_m = 1.0;       ///< choice: two answers further apart than this contradict each other
  double distinct_score = 0.1;   ///< choice: an answer must be better than its rivals by this share of overlap
  double gate_sigma = 3.77;      ///< 99.7 % of three degrees of freedom
  double sigma_floor_m = 0.03;   ///< choice: two passes see a kerb from different sides
  double sigma_floor_deg = 0.1;  ///< choice
  int consistent_count = 3;      ///< choice: SuMa needs 5 of its dense candidates
  double window_m = 30.0;        ///< choice: within it odometry is good to centimetres
};
template <class Visitor>
void visit_fields(CloseLoopConfig& c, Visitor&& field) {
  field("close_loop.min_gap_m", c.min_gap_m, 1.0, 10000.0, "path driven since a place, before it can be a loop");
  field("close_loop.every_m", c.every_m, 0.0, 1000.0, "path driven between two attempts");
  field("close_loop.sure_every_m", c.sure_every_m, 0.0, 1000.0, "the same, while loops are being accepted");
  field("close_loop.radius_m", c.radius_m, 1.0, 100.0, "distance of candidates when the pose is certain");
  field("close_loop.max_radius_m", c.max_radius_m, 1.0, 500.0, "greatest distance of candidates, however uncertain");
  field("close_loop.neighbourhood_m", c.neighbourhood_m, 0.0, 100.0,
        "path before and after a candidate whose lines are used");
  field("close_loop.start_spacing_m", c.start_spacing_m, 0.1, 10.0,
        "distance of the starts tried around an uncertain guess");
  field("close_loop.max_starts_per_side", c.max_starts_per_side, 0, 20,
        "starts on each side of the guess, per direction");
  field("close_loop.min_overlap", c.min_overlap, 0.0, 1.0,
        "share of the keyframe's lines that must find the candidate's");
  field("close_loop.max_rms_m", c.max_rms_m, 0.01, 1.0, "greatest matching error");
  field("close_loop.distinct_m", c.distinct_m, 0.1, 100.0,
        "two answers of the matcher further apart than this are rivals");
  field("close_loop.distinct_score", c.distinct_score, 0.0, 1.0,
        "lead of the best answer over a rival, as share of overlap");
  field("close_loop.gate_sigma", c.gate_sigma, 0.5, 100.0, "a loop further from the odometry than this is refused");
  field("close_loop.sigma_floor_m", c.sigma_floor_m, 0.0, 10.0, "standard deviation added to every loop");
  field("close_loop.sigma_floor_deg", c.sigma_floor_deg, 0.0, 10.0, "standard deviation added to every loop's heading");
  field("close_loop.consistent_count", c.consistent_count, 1, 50, "loops that must agree before the first is accepted");
  field("close_loop.window_m", c.window_m, 1.0, 1000.0, "path within which loops are compared");
}

/// What became of the attempts: each ends as exactly one of these. `waiting` becomes `accepted` when others agree.
struct CloseLoopReport {
  std::uint64_t attempt_count = 0, no_candidate_count = 0;
  std::uint64_t looked_at_count = 0;  ///< keyframes in the squares around, all attempts together
  std::uint64_t too_few_lines_count = 0, poor_overlap_count = 0, poor_fit_count = 0, diverged_count = 0;
  std::uint64_t ambiguous_count = 0, contradicts_odometry_count = 0;
  std::uint64_t waiting_count = 0, accepted_count = 0;
};

/// Whether it was measured in every direction, to a metre or better.
[[nodiscard]] bool is_full(const PoseEdge& loop);

/// Step 7, close loops: finds where the vehicle is back at a place it has mapped, by matching local vector maps
/// [He2018, III-D].
///
/// One run() per keyframe, after it was added to the graph. The work of a run does not grow with the drive.
/// Deterministic. Differs from the paper: candidates by the uncertainty that odometry has gathered since; several
/// starts; a loop needs others that agree with it; what fits two places, or contradicts the odometry's covariance, is
/// refused.
class LoopCloser {
 public:
  LoopCloser(const CloseLoopConfig& config, const MatchConfig& match_config);

  /// The loops that became certain with the newest keyframe. Valid until the next call.
  const std::vector<PoseEdge>& run(const PoseGraph& graph, std::span<const KeptKeyframe> keyframes);
  /// The graph's poses moved, from keyframe `first` on.
  void poses_changed(const PoseGraph& graph, std::size_t first);
  [[nodiscard]] const CloseLoopReport& report() const { return report_; }

  // Of an earlier drive:

  /// Enters its keyframes, all that the graph has; run() looks for loops among those that come after them, until
  /// found_itself().
  void recall(const PoseGraph& graph);
  void found_itself() { first_candidate_ = 0; }
  /// The loop between the newest keyframe and the earlier drive if the vehicle is at about `T_map_vehicle`, as surely
  /// as `covariance` says in the vehicle's axes, and up to 30 m away. Takes a hundred times as long as run().
  std::optional<PoseEdge> look_around(const PoseGraph& graph, std::span<const KeptKeyframe> keyframes,
                                      const Pose2& T_map_vehicle, const PoseCovariance& covariance);
  /// Whether two loops say the same: a's answer, carried along the odometry of both passes, is b's.
  [[nodiscard]] bool agree(const PoseGraph& graph, const PoseEdge& a, const PoseEdge& b) const;

 private:
  struct Pending {
    PoseEdge edge;
    double travelled_m = 0;
    bool accepted = false;
  };
  void enter(const PoseGraph& graph, std::size_t keyframe);
  [[nodiscard]] PoseCovariance chain_covariance(std::size_t from, std::size_t to) const;
  [[nodiscard]] PoseCovariance relative_covariance(const PoseGraph& graph, std::size_t from, std::size_t to) const;
  struct Range {
    std::size_t first, end;
  };
  [[nodiscard]] std::optional<std::size_t> nearest_candidate(const PoseGraph& graph, const Pose2& here, Range among);
  /// How far around a guess is looked, and what then counts.
  struct Effort {
    int most_starts_per_side;
    double start_spacing_m, min_overlap;
  };
  std::optional<PoseEdge> match_with(std::size_t candidate, const Pose2& guess, const PoseCovariance& covariance,
                                     const Effort& effort, const PoseGraph& graph,
                                     std::span<const KeptKeyframe> keyframes);
  void collect_reference(std::size_t candidate, const PoseGraph& graph, std::span<const KeptKeyframe> keyframes);
  [[nodiscard]] static std::vector<Pose2> starts(const Pose2& guess, const PoseCovariance& covariance,
                                                 const Effort& effort);
  std::optional<Match> best_match(const Pose2& guess, const PoseCovariance& covariance, const Effort& effort);
  void count(MatchVerdict verdict);
  void confirm(const PoseGraph& graph);

  CloseLoopConfig config_;
  Eigen::Matrix3d floor_;  ///< covariance added to every loop
  Matcher matcher_;
  LineSet reference_, unregistered_;
  std::map<std::pair<int, int>, std::vector<std::size_t>> cells_;  ///< keyframes by place
  std::vector<std::optional<std::pair<int, int>>> cell_of_;        ///< of each keyframe; none: its place was known
  std::vector<PoseCovariance>
      gathered_;  ///< odometry's covariance since the first keyframe, as a twist of the map frame
  std::vector<Pending> pending_;
  std::vector<PoseEdge> confirmed_;
  std::optional<PoseEdge> last_full_loop_;  ///< newest in the poses that observed every direction
  double last_attempt_m_ = -1e9, last_confirmed_m_ = -1e9;
  std::size_t first_candidate_ = 0;
  CloseLoopReport report_;
};

}  // namespace roadvec
