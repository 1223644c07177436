#include "core/boundary/virtual_scan.h"

#include <cmath>

#include "core/base/angle.h"
#include "core/boundary/ray.h"

namespace roadvec {

VirtualScanner::VirtualScanner(const VirtualScanConfig& config) {
  const auto count = static_cast<std::size_t>(config.ray_count);
  for (std::size_t k = 0; k < count; ++k) {
    const double angle_rad = -kTwoPi * static_cast<double>(k) / static_cast<double>(count);
    directions_.emplace_back(std::cos(angle_rad), std::sin(angle_rad));
  }
  scan_.rays.resize(count);
}

const VirtualScan& VirtualScanner::run(const CellMap& cells, const Eigen::Vector2d& origin_odom) noexcept {
  const Window& window = cells.window();
  scan_.cells = &cells;
  scan_.origin_window_m = origin_odom - window.origin_odom();
  for (std::size_t k = 0; k < directions_.size(); ++k) {
    VirtualScan::Ray ray;
    walk_ray(window, scan_.origin_window_m.x(), scan_.origin_window_m.y(), directions_[k].x(), directions_[k].y(),
             [&](int index, int, int) {
               if (!cells.has(index)) return true;
               ray.slot = cells.slot(index);
               return false;
             });
    if (ray.slot >= 0) {
      const BoundaryCell& cell = cells.cells()[static_cast<std::size_t>(ray.slot)];
      ray.range_m = static_cast<float>((Eigen::Vector2d(cell.x_m, cell.y_m) - scan_.origin_window_m).norm());
    }
    scan_.rays[k] = ray;
  }
  return scan_;
}

}  // namespace roadvec
