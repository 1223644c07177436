#pragma once

#include <span>
#include <vector>

#include "core/graph/close_loop.h"
#include "core/graph/recollection.h"

namespace roadvec {

/// Finds where in the map of an earlier drive the vehicle is: looks around every guess in turn, and believes one when a
/// stretch of road agrees with it that is longer than a crossing, at nearly every look. Not part of the paper's method,
/// whose map ends with the drive. Deterministic; at most 0.2 s every 4 m, and every 10 m once it has looked for long.
class SelfFinder {
 public:
  explicit SelfFinder(std::span<const StartGuess> guesses);

  /// For each keyframe until it is found: the loops between the two drives that agree, or none.
  std::vector<PoseEdge> run(LoopCloser& loop_closer, const PoseGraph& graph, std::span<const KeptKeyframe> keyframes);
  [[nodiscard]] double searched_m() const { return searched_m_; }

 private:
  struct Look {
    double travelled_m = 0;
    std::optional<PoseEdge> loop;
  };
  struct Lead {
    StartGuess guess;
    std::vector<Look> looks;  ///< of the last metres
  };
  [[nodiscard]] static std::vector<PoseEdge> agreeing(const Lead& lead, const LoopCloser& loop_closer,
                                                      const PoseGraph& graph);

  std::vector<Lead> leads_;
  std::size_t next_lead_ = 0;
  Pose2 T_start_odom_;
  double start_m_ = -1, next_look_m_ = 0, searched_m_ = 0;
};

}  // namespace roadvec
