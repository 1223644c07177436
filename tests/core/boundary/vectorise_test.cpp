#include "core/boundary/vectorise.h"

#include <gtest/gtest.h>

#include "core/boundary/simplify.h"

namespace roadvec {
namespace {

const WindowConfig kDefaultWindow;

/// Scans a hand-drawn set of boundary points from an eye.
struct Scene {
  CellMap map{kDefaultWindow};
  VirtualScanner scanner{{}};
  Vectoriser vectoriser{{}};

  Scene() {
    Window window(kDefaultWindow);
    window.centre_on({0, 0});
    map.restart(window);
  }
  void draw(Eigen::Vector2d from, const Eigen::Vector2d& to, float height_m = 0.12F) {
    const Eigen::Vector2d step = (to - from).normalized() * 0.05;
    int last = -1;
    for (int i = 0; i * 0.05 <= (to - from).norm(); ++i) {
      const Eigen::Vector2d p = from + i * step - map.window().origin_odom();
      const int index = map.window().index(static_cast<int>(p.x() / 0.2), static_cast<int>(p.y() / 0.2));
      if (index != last && map.slot(index) < 0) {
        map.add(index, {static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F, height_m, 0.02F, 0.9F, 10});
      }
      last = index;
    }
  }
  const LineSet& lines(const Eigen::Vector2d& eye = {0, 0}) { return vectoriser.run(scanner.run(map, eye), Pose2{}); }
};

double length_m(std::span<const Vertex> vertices) {
  double sum = 0;
  for (std::size_t i = 1; i < vertices.size(); ++i) sum += (vertices[i].position() - vertices[i - 1].position()).norm();
  return sum;
}

TEST(Vectoriser, a_straight_kerb_is_one_line_from_end_to_end) {
  Scene scene;
  scene.draw({-20, 4}, {20, 4});
  const LineSet& lines = scene.lines();
  ASSERT_EQ(lines.lines().size(), 1U);
  EXPECT_NEAR(length_m(lines.vertices()), 40, 2.0);
  EXPECT_EQ(lines.lines()[0].attributes.kind, BoundaryKind::curb);
  for (const Vertex& v : lines.vertices()) EXPECT_NEAR(v.y_m, 4, 1e-4);
}

TEST(Vectoriser, the_mouth_of_a_street_stays_open) {
  Scene scene;
  scene.draw({-20, 4}, {-3, 4});
  scene.draw({3, 4}, {20, 4});
  const LineSet& lines = scene.lines();
  ASSERT_EQ(lines.lines().size(), 2U);
  for (const LineSet::Line& line : lines.lines()) {
    const bool right = lines.vertices_of(line).front().x_m > 0;
    EXPECT_EQ(right ? line.attributes.first_end : line.attributes.last_end, EndKind::open);
  }
}

TEST(Vectoriser, what_a_parked_car_hides_is_an_occluded_end) {
  Scene scene;
  scene.draw({-20, 6}, {20, 6});
  scene.draw({-2, 3}, {2, 3}, 1.4F);
  const LineSet& lines = scene.lines();
  ASSERT_EQ(lines.lines().size(), 3U);
  for (const LineSet::Line& line : lines.lines()) {
    const Vertex& first = lines.vertices_of(line).front();
    if (line.attributes.kind == BoundaryKind::barrier) continue;
    const bool right = first.x_m > 0;
    EXPECT_EQ(right ? line.attributes.first_end : line.attributes.last_end, EndKind::occluded);
  }
}

TEST(Vectoriser, lines_run_clockwise_and_are_not_cut_at_the_first_ray) {
  Scene scene;
  scene.draw({4, -10}, {4, 10});  // across ray 0
  const LineSet& lines = scene.lines();
  ASSERT_EQ(lines.lines().size(), 1U);
  EXPECT_GT(lines.vertices().front().y_m, lines.vertices().back().y_m);
}

TEST(Vectoriser, a_closed_yard_gives_its_whole_outline) {
  Scene scene;
  scene.draw({-5, -5}, {5, -5});
  scene.draw({5, -5}, {5, 5});
  scene.draw({5, 5}, {-5, 5});
  scene.draw({-5, 5}, {-5, -5});
  const LineSet& lines = scene.lines({0.05, 0.05});
  double total_m = 0;
  for (const LineSet::Line& line : lines.lines()) total_m += length_m(lines.vertices_of(line));
  EXPECT_NEAR(total_m, 40, 2);
}

TEST(Vectoriser, a_single_pole_is_no_line) {
  Scene scene;
  scene.draw({5, 5}, {5.2, 5.2}, 2.0F);
  EXPECT_TRUE(scene.lines().empty());
}

TEST(Vectoriser, an_empty_grid_gives_no_lines) {
  Scene scene;
  EXPECT_TRUE(scene.lines().empty());
}

}  // namespace
}  // namespace roadvec
