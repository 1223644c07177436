#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/boundary/virtual_scan.h"
#include "core/geometry/line_set.h"

namespace roadvec {

struct VectoriseConfig {
  double near_gap_m = 0.45;           ///< two cells diagonally apart still belong together
  double far_gap_m = 1.5;             ///< a gap that a person walks through stays open; a car needs more
  double least_incidence_rad = 0.06;  ///< 3.4 deg: flatter than this the next hit tells nothing of the surface between
  int vertex_count = 4;               ///< shorter lines are clutter (choice)
  double length_m = 0.6;
  double curb_height_m = 0.35;  ///< a wheel climbs what is lower: kerbs are 6-25 cm
};
template <class Visitor>
void visit_fields(VectoriseConfig& c, Visitor&& field) {
  field("vectorise.near_gap_m", c.near_gap_m, 0.1, 5.0, "neighbouring hits closer than this always belong to one line");
  field("vectorise.far_gap_m", c.far_gap_m, 0.1, 10.0, "neighbouring hits farther apart than this never do");
  field("vectorise.least_incidence_rad", c.least_incidence_rad, 0.005, 1.0,
        "between the two, hits belong together unless their line meets the rays at less than this angle");
  field("vectorise.vertex_count", c.vertex_count, 2, 100, "hits that make a line");
  field("vectorise.length_m", c.length_m, 0.0, 20.0, "shortest line");
  field("vectorise.curb_height_m", c.curb_height_m, 0.05, 1.0, "lines whose median height is below this are curbs");
}

/// Step 4, vectorise: neighbouring hits of a virtual scan cluster into boundaries, their order gives a polyline each:
/// the raw LVM [He2018, III-B-1]. Misses between clusters are open ends.
///
/// Differs from the paper: three kinds of end (open, unseen, occluded), and the gap that may be closed grows with range
/// and shrinks with flat incidence. O(rays). No allocation once warm.
class Vectoriser {
 public:
  explicit Vectoriser(const VectoriseConfig& config);
  /// Lines in the frame that T_out_odom leads to, clockwise as seen from the scan's origin: the free side is on their
  /// right. Valid until the next call.
  const LineSet& run(const VirtualScan& scan, const Pose2& T_out_odom) noexcept;
  /// Rays that met the lines of the last run(): the vertices of the paper's raw LVM, which has one for each ray.
  [[nodiscard]] std::uint64_t ray_count() const { return ray_count_; }

 private:
  struct Hit {
    const BoundaryCell* cell;
    std::size_t first_ray, last_ray;
    double range_m;
  };
  void collect(const VirtualScan& scan) noexcept;
  [[nodiscard]] bool connected(const Hit& a, const Hit& b, std::size_t ray_count) const noexcept;
  [[nodiscard]] EndKind end_between(const Hit& here, const Hit& other, std::size_t rays_apart,
                                    double range_m) const noexcept;
  void emit(std::size_t first, std::size_t last, const VirtualScan& scan, const Pose2& T_out_odom) noexcept;

  VectoriseConfig config_;
  std::vector<Hit> hits_;
  std::vector<float> heights_m_;
  LineSet lines_;
  std::uint64_t ray_count_ = 0;
};

}  // namespace roadvec
