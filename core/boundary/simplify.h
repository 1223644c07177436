#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/geometry/line_set.h"

namespace roadvec {

struct SimplifyConfig {
  double tolerance_m = 0.06;  ///< paper: "6 % of the points stay"; 0.06 m keeps 4-6 % on the shipped drives (measured)
};
template <class Visitor>
void visit_fields(SimplifyConfig& c, Visitor&& field) {
  field("simplify.tolerance_m", c.tolerance_m, 0.005, 1.0, "largest distance of a dropped vertex from the kept line");
}

/// Step 5, simplify: drops the vertices a boundary line does not need [DouglasPeucker1973] [He2018, III-B-2].
///
/// First and last vertex stay. Every dropped vertex lies within tolerance_m of the segment that replaces it. Any metric
/// frame. O(n log n) usual, O(n^2) worst. Buffers are reused: no allocation once warm.
class Simplifier {
 public:
  explicit Simplifier(const SimplifyConfig& config);
  /// Every line of `lines`; attributes stay. Valid until the next call.
  const LineSet& run_all(const LineSet& lines);
  /// Indices of the vertices that stay, ascending. Valid until the next call.
  const std::vector<std::uint32_t>& kept(std::span<const Vertex> line);

 private:
  SimplifyConfig config_;
  LineSet simplified_;
  std::vector<std::uint32_t> kept_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> open_;
};

}  // namespace roadvec
