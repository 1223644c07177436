#include "core/boundary/virtual_scan.h"

#include <gtest/gtest.h>

#include <set>

#include "core/boundary/ray.h"

namespace roadvec {
namespace {

const WindowConfig kSmall{.cell_m = 0.5, .range_m = 10};

CellMap map_with(const std::vector<std::pair<int, int>>& cells) {
  CellMap map(kSmall);
  Window window(kSmall);
  window.centre_on({0, 0});
  map.restart(window);
  for (const auto& [column, row] : cells) {
    map.add(window.index(column, row),
            {static_cast<float>((column + 0.5) * 0.5), static_cast<float>((row + 0.5) * 0.5)});
  }
  return map;
}

TEST(WalkRay, visits_neighbours_that_share_an_edge) {
  Window window(kSmall);
  window.centre_on({0, 0});
  for (int k = 0; k < 360; ++k) {
    int last = -1;
    walk_ray(window, 10.1, 10.3, std::cos(k * 0.01745), std::sin(k * 0.01745), [&](int index, int, int) {
      if (last >= 0) {
        const int moved = std::abs(index % window.size() - last % window.size()) +
                          std::abs(index / window.size() - last / window.size());
        EXPECT_EQ(moved, 1) << "ray " << k;
      }
      last = index;
      return true;
    });
    EXPECT_GE(last, 0);
  }
}

TEST(VirtualScanner, a_diagonal_wall_one_cell_thick_does_not_leak) {
  std::vector<std::pair<int, int>> wall;
  for (int i = 0; i <= 40; ++i) wall.emplace_back(i, 40 - i);  // corner to corner, touching only at corners
  const CellMap map = map_with(wall);
  VirtualScanner scanner({.ray_count = 1440});
  const VirtualScan& scan = scanner.run(map, {-3.05, -3.07});
  for (std::size_t k = 0; k < scan.rays.size(); ++k) {
    const Eigen::Vector2d& d = scanner.direction(k);
    if (std::abs(d.x() + d.y()) < 0.6) continue;  // past the wall's ends
    EXPECT_EQ(scan.rays[k].slot >= 0, d.x() + d.y() > 0) << "ray " << k;
  }
}

TEST(VirtualScanner, hits_on_the_axes_and_on_the_rim_count) {
  const CellMap map = map_with({{40, 20}, {0, 20}, {20, 40}, {20, 0}});
  VirtualScanner scanner({.ray_count = 360});
  const VirtualScan& scan = scanner.run(map, {0.25, 0.25});
  for (const std::size_t k : {0U, 90U, 180U, 270U}) EXPECT_GE(scan.rays[k].slot, 0) << "ray " << k;
}

TEST(VirtualScanner, only_the_first_boundary_on_a_ray_stays) {
  const CellMap map = map_with({{30, 20}, {34, 20}});
  VirtualScanner scanner({.ray_count = 360});
  const VirtualScan& scan = scanner.run(map, {0.25, 0.25});
  EXPECT_EQ(scan.rays[0].slot, 0);
  EXPECT_NEAR(scan.rays[0].range_m, 5.0, 1e-5);
}

TEST(VirtualScanner, an_origin_outside_the_window_hits_nothing) {
  const CellMap map = map_with({{30, 20}});
  VirtualScanner scanner({.ray_count = 90});
  for (const VirtualScan::Ray& ray : scanner.run(map, {500, 500}).rays) EXPECT_LT(ray.slot, 0);
}

}  // namespace
}  // namespace roadvec
