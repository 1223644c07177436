#include "core/boundary/fuse.h"

#include <gtest/gtest.h>

#include <random>

namespace roadvec {
namespace {

const WindowConfig kWindow{.cell_m = 0.2, .range_m = 20};
constexpr std::size_t kCells = 201UL * 201UL;

/// One sweep that sees boundary points at the given odom positions from `eye`.
struct World {
  VirtualScanner scanner{{.ray_count = 1440}};
  CellMap map{kWindow};
  std::vector<std::uint8_t> seen = std::vector<std::uint8_t>(kCells, 1);

  const VirtualScan& look(const Eigen::Vector2d& eye, const std::vector<Eigen::Vector2d>& points,
                          bool edge_seen = true) {
    Window window(kWindow);
    window.centre_on(eye);
    map.restart(window);
    for (const Eigen::Vector2d& p : points) {
      const Eigen::Vector2d q = p - window.origin_odom();
      const int column = static_cast<int>(q.x() / 0.2), row = static_cast<int>(q.y() / 0.2);
      map.add(window.index(column, row),
              {static_cast<float>(q.x()), static_cast<float>(q.y()), 0.0F, 0.12F, 0.01F, 1.0F, 5, edge_seen});
    }
    return scanner.run(map, eye);
  }
};

std::vector<Eigen::Vector2d> positions(LocalGrid& grid) {
  std::vector<Eigen::Vector2d> result;
  const CellMap& map = grid.cells();
  for (const BoundaryCell& cell : map.cells()) {
    result.push_back(map.window().origin_odom() + Eigen::Vector2d(cell.x_m, cell.y_m));
  }
  return result;
}

TEST(LocalGrid, one_hit_is_not_a_boundary_two_are) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  grid.fuse(world.look({0, 0}, {{5.03, 1.07}}), world.scanner, world.seen, {});
  EXPECT_TRUE(positions(grid).empty());
  grid.fuse(world.look({0, 0}, {{5.03, 1.07}}), world.scanner, world.seen, {});
  ASSERT_EQ(positions(grid).size(), 1U);
  EXPECT_LT((positions(grid)[0] - Eigen::Vector2d(5.03, 1.07)).norm(), 1e-5);
}

TEST(LocalGrid, averages_positions_finer_than_a_cell) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.02);
  for (int i = 0; i < 40; ++i) {
    grid.fuse(world.look({0, 0}, {{5.1 + noise(random), 1.1 + noise(random)}}), world.scanner, world.seen, {});
  }
  ASSERT_EQ(positions(grid).size(), 1U);
  EXPECT_LT((positions(grid)[0] - Eigen::Vector2d(5.1, 1.1)).norm(), 0.012);
}

TEST(LocalGrid, free_space_clears_what_moved) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  for (int i = 0; i < 20; ++i) grid.fuse(world.look({0, 0}, {{5.1, 1.1}}), world.scanner, world.seen, {});
  ASSERT_EQ(positions(grid).size(), 1U);
  for (int i = 0; i < 12; ++i) grid.fuse(world.look({0, 0}, {{9.5, 2.03}}), world.scanner, world.seen, {});
  for (const Eigen::Vector2d& p : positions(grid)) EXPECT_GT(p.x(), 9);
}

TEST(LocalGrid, a_kerb_that_no_ring_reaches_is_not_cleared) {
  World world;
  LocalGrid kerbs({}, kWindow, FreeSpace::where_seen), structure({}, kWindow, FreeSpace::where_passed);
  for (int i = 0; i < 5; ++i) {
    kerbs.fuse(world.look({0, 0}, {{5.1, 1.1}}), world.scanner, world.seen, {});
    structure.fuse(world.look({0, 0}, {{5.1, 1.1}}), world.scanner, world.seen, {});
  }
  std::fill(world.seen.begin(), world.seen.end(), std::uint8_t{0});
  for (int i = 0; i < 20; ++i) {
    kerbs.fuse(world.look({0, 0}, {}), world.scanner, world.seen, {});
    structure.fuse(world.look({0, 0}, {}), world.scanner, world.seen, {});
  }
  EXPECT_EQ(positions(kerbs).size(), 1U);
  EXPECT_TRUE(positions(structure).empty());
}

TEST(LocalGrid, beside_a_kerbs_edge_its_top_is_no_boundary) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  const Eigen::Vector2d edge(5.1, 3.1), top(5.1, 3.3);
  const auto only = [&](const Eigen::Vector2d& p) {
    return positions(grid).size() == 1 && (positions(grid)[0] - p).norm() < 1e-5;
  };
  for (int i = 0; i < 3; ++i) grid.fuse(world.look({0, 0}, {top}, false), world.scanner, world.seen, {});
  EXPECT_TRUE(only(top));
  for (int i = 0; i < 5; ++i) grid.fuse(world.look({0, 0}, {edge}), world.scanner, world.seen, {});
  EXPECT_TRUE(only(edge));
  for (int i = 0; i < 9; ++i) grid.fuse(world.look({5.1, 6}, {top}, false), world.scanner, world.seen, {});
  EXPECT_TRUE(only(edge));
}

TEST(LocalGrid, a_position_is_that_of_the_edge_once_it_was_seen) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  const Eigen::Vector2d edge(5.1, 3.05), top(5.1, 3.15);  // one cell
  for (const bool edge_seen : {false, false, true, false, true, false}) {
    grid.fuse(world.look({0, 0}, {edge_seen ? edge : top}, edge_seen), world.scanner, world.seen, {});
  }
  ASSERT_EQ(positions(grid).size(), 1U);
  EXPECT_LT((positions(grid)[0] - edge).norm(), 1e-5);
}

TEST(LocalGrid, rolls_without_moving_anything_and_forgets_what_left) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  const Eigen::Vector2d pole(5.03, 1.07);
  for (int i = 0; i < 3; ++i) grid.fuse(world.look({0, 0}, {pole}), world.scanner, world.seen, {});
  std::fill(world.seen.begin(), world.seen.end(), std::uint8_t{0});
  for (double x = 0; x < 24; x += 0.73) grid.fuse(world.look({x, -0.3 * x}, {}), world.scanner, world.seen, {});
  ASSERT_EQ(positions(grid).size(), 1U);
  EXPECT_LT((positions(grid)[0] - pole).norm(), 1e-5);
  grid.fuse(world.look({60, 0}, {}), world.scanner, world.seen, {});
  EXPECT_TRUE(positions(grid).empty());
  for (double x = 60; x > 0; x -= 0.73) grid.fuse(world.look({x, 0}, {}), world.scanner, world.seen, {});
  EXPECT_TRUE(positions(grid).empty());
}

TEST(LocalGrid, correction_moves_the_hits) {
  World world;
  LocalGrid grid({}, kWindow, FreeSpace::where_seen);
  for (int i = 0; i < 3; ++i) grid.fuse(world.look({0, 0}, {{5.0, 1.1}}), world.scanner, world.seen, {0.1, 0.05, 0});
  ASSERT_EQ(positions(grid).size(), 1U);
  EXPECT_LT((positions(grid)[0] - Eigen::Vector2d(5.1, 1.15)).norm(), 1e-5);
}

}  // namespace
}  // namespace roadvec
