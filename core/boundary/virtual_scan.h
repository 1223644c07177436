#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/boundary/window.h"

namespace roadvec {

struct VirtualScanConfig {
  int ray_count =
      1440;  ///< 0.25 deg: a cell of 0.2 m is one ray wide at 46 m, so none inside the window is stepped over
};
template <class Visitor>
void visit_fields(VirtualScanConfig& c, Visitor&& field) {
  field("virtual_scan.ray_count", c.ray_count, 90, 7200, "rays of a virtual scan, evenly over the full circle");
}

/// What the rays from one place meet first. Rays go round clockwise [He2018, III-B-1]: ray k leaves at -2 pi k /
/// rays.size() from the odom frame's x axis.
struct VirtualScan {
  struct Ray {
    std::int32_t slot = -1;  ///< of the cell hit, in cells->cells(); -1: a miss, the ray left the window
    float range_m = 0;       ///< to the boundary inside the cell; a miss: 0
  };
  const CellMap* cells = nullptr;  ///< borrowed: valid as long as what was scanned
  Eigen::Vector2d origin_window_m = Eigen::Vector2d::Zero();
  std::vector<Ray> rays;
};

/// Step 2, virtual scan: rays from the vehicle, the first boundary cell on each stays, the rest goes [He2018, III-B-1].
///
/// Differs from the paper: rays are even in angle, not one per cell of the grid's rim (dense in corners, sparse ahead);
/// hits on the axes and on the rim count; cells are walked exactly. O(rays * cells across). No allocation.
class VirtualScanner {
 public:
  explicit VirtualScanner(const VirtualScanConfig& config);
  /// Valid until the next call and as long as `cells`.
  const VirtualScan& run(const CellMap& cells, const Eigen::Vector2d& origin_odom) noexcept;

  /// Unit direction of ray k.
  [[nodiscard]] const Eigen::Vector2d& direction(std::size_t k) const { return directions_[k]; }

 private:
  std::vector<Eigen::Vector2d> directions_;
  VirtualScan scan_;
};

}  // namespace roadvec
