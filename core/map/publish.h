#pragma once

#include <map>
#include <set>
#include <vector>

#include "core/boundary/simplify.h"
#include "core/map/dense_lines.h"
#include "core/map/vector_map.h"

namespace roadvec {

struct PublishConfig {
  double tolerance_m = 0.05;   ///< choice: half of the goal for a boundary's error
  double shift_m = 0.02;       ///< choice: below the noise of one observation
  double growth_m = 1.0;       ///< choice: one keyframe's step
  double min_length_m = 1.0;   ///< choice: shorter lines help no planner
  int min_keyframe_count = 2;  ///< choice: what only one keyframe saw is provisional
};
template <class Visitor>
void visit_fields(PublishConfig& c, Visitor&& field) {
  field("concatenate.publish_tolerance_m", c.tolerance_m, 0.001, 1.0,
        "largest distance of the published from the kept line");
  field("concatenate.publish_shift_m", c.shift_m, 0.0, 1.0, "a line is published again when a vertex moved farther");
  field("concatenate.publish_growth_m", c.growth_m, 0.0, 50.0, "a line is published again when it grew by more");
  field("concatenate.min_length_m", c.min_length_m, 0.0, 50.0, "shorter lines are not published");
  field("concatenate.min_keyframe_count", c.min_keyframe_count, 1, 100,
        "lines seen by fewer keyframes are not published");
}

/// Makes the published map from the dense lines: simplified, whole millimetres, and only when something changed that
/// matters.
///
/// Kept vertices are then moved across the line to where they fit the dropped ones best: RDP keeps the extreme vertices
/// of a noisy line [DouglasPeucker1973], which are the worst estimate of where it runs. A line is simplified piece by
/// piece between fixed anchors, and a piece is made anew only when one of its vertices moved: so a long line that grows
/// at one end keeps its bytes elsewhere.
class LinePublisher {
 public:
  explicit LinePublisher(const PublishConfig& config)
      : config_(config), simplifier_({.tolerance_m = config.tolerance_m}) {}

  /// Looks at the lines `ids`, in `lines` or gone from it. `successors`: of lines that may have gone.
  void run(DenseLines& lines, const std::set<LineId>& ids, const std::map<LineId, std::vector<LineId>>& successors,
           bool everything, MapChange& change);
  [[nodiscard]] const VectorMap& map() const { return map_; }

 private:
  [[nodiscard]] bool qualifies(const DenseLine& line) const;
  [[nodiscard]] bool worth_publishing(const DenseLine& line) const;
  void refresh(DenseLine& line, bool everything) const;
  [[nodiscard]] MapLine make(const DenseLine& line);
  void fit(const std::vector<std::uint32_t>& kept);
  void upsert(MapLine&& line, MapChange& change);
  void remove(LineId id, const std::map<LineId, std::vector<LineId>>& successors, MapChange& change);

  PublishConfig config_;
  Simplifier simplifier_;
  VectorMap map_;
  std::map<LineId, std::uint32_t> retired_revisions_;  ///< so that an id that comes back continues its count
  std::vector<Vertex> piece_;                          ///< dense vertices between two anchors
  std::vector<Eigen::Vector2d> fitted_;                ///< one per kept vertex of the piece
};

}  // namespace roadvec
