#pragma once

#include <cstddef>

#include "core/graph/pose_graph.h"

namespace roadvec {

struct OptimiseConfig {
  double loop_scale_sigma = 2.0;   ///< choice: a loop beyond two of its sigmas starts to lose influence (Cauchy)
  double loop_gate_sigma = 3.77;   ///< 99.7 % of three degrees of freedom, as 3 sigma is of one [Labbe2019]
  int max_iterations = 20;         ///< usual: 4 to 8
  int max_rounds = 5;              ///< solves with a loop switched off between; choice
  double min_error_sigma = 1.0;    ///< choice: a loop that the poses already agree with brings no news
  double node_spacing_m = 50.0;    ///< choice: what is neglected along it is some mm for a correction of 1 m
  double window_m = 1000.0;        ///< choice: odometry drifts by some metres on it
  double whole_m_per_node = 1.0;   ///< choice: a node costs some 0.1 ms, so at 20 m/s the whole takes 1 % of a core
  double rederive_shift_m = 0.05;  ///< choice: half of the goal for a boundary's error
  double rederive_every_m = 30.0;  ///< choice: loops come in rows; small corrections wait until this far from the last
  double rederive_now_m = 0.5;     ///< choice: the gate of concatenate; beyond it new lines would miss the old ones
};
template <class Visitor>
void visit_fields(OptimiseConfig& c, Visitor&& field) {
  field("optimise.loop_scale_sigma", c.loop_scale_sigma, 0.1, 100.0,
        "error in sigmas beyond which a loop loses influence");
  field("optimise.loop_gate_sigma", c.loop_gate_sigma, 0.5, 100.0,
        "error in sigmas beyond which a loop is switched off");
  field("optimise.max_iterations", c.max_iterations, 1, 200, "iterations of one solve");
  field("optimise.max_rounds", c.max_rounds, 1, 50, "solves of one call; between them the worst loop is switched off");
  field("optimise.min_error_sigma", c.min_error_sigma, 0.0, 100.0,
        "new loops nearer to the poses than this wait for others");
  field("optimise.node_spacing_m", c.node_spacing_m, 1.0, 1000.0,
        "keyframes without loops are solved for every so far; between them odometry decides");
  field("optimise.window_m", c.window_m, 10.0, 100000.0,
        "a loop moves the path since the loop before it, and so much of what lies before");
  field("optimise.whole_m_per_node", c.whole_m_per_node, 0.0, 1000.0,
        "the whole path is solved for when so much was driven, per node, since the last time");
  field("optimise.rederive_shift_m", c.rederive_shift_m, 0.0, 10.0,
        "the map is derived again when a pose moved farther");
  field("optimise.rederive_every_m", c.rederive_every_m, 0.0, 10000.0, "path between two derivations of the map");
  field("optimise.rederive_now_m", c.rederive_now_m, 0.0, 100.0,
        "a pose that moved farther does not wait for that path");
}

struct OptimiseReport {
  bool solved = false;
  int iteration_count = 0, round_count = 0;
  std::size_t switched_off_count = 0;  ///< of all loops
  std::size_t node_count = 0;          ///< poses solved for
  double initial_cost = 0, final_cost = 0;
};

/// Step 8, optimise: the poses that agree best with odometry and matching constraints [He2018, III-D], by Ceres.
///
/// Solved for are the keyframes where loops end, every node_spacing_m one between them, and the newest; the odometry
/// between two of them counts as one edge, and its steps then take their shares of the correction by their covariances.
/// Edges count with their full 3 x 3 information. After each solve the loop that contradicts the rest most is switched
/// off when it is beyond loop_gate_sigma; every call starts with its loops on again, so a loop that was switched off
/// returns when later ones confirm it. When a solve fails, poses and loops stay as they were. One thread, limits in
/// nodes and iterations and not in time: same graph, same bytes. Differs from the paper: Ceres instead of g2o; robust
/// loss on loops, because one false loop destroys a map; the work depends on the loops and the way, not on the
/// keyframes.
class Optimiser {
 public:
  explicit Optimiser(const OptimiseConfig& config) : config_(config) {}
  /// Keyframes before `first_free`, at least the first one, stay, and so do loops between them.
  OptimiseReport run(PoseGraph& graph, std::size_t first_free = 1) const;

 private:
  OptimiseConfig config_;
};

/// How far two poses are from what an edge says, in its own sigmas: sqrt(e^T information e).
[[nodiscard]] double edge_error_sigma(const PoseGraph& graph, const PoseEdge& edge);

}  // namespace roadvec
