#include "core/boundary/simplify.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/geometry/segment.h"

namespace roadvec {
namespace {

LineSet noisy_kerb(unsigned seed, double sigma_m) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma_m);
  LineSet line;
  line.begin_line({.kind = BoundaryKind::curb});
  double x = 0, y = 0, heading = 0.1 * seed;
  for (int i = 0; i < 200; ++i) {
    heading += 0.02 * std::sin(0.05 * i + seed);
    x += 0.2 * std::cos(heading);
    y += 0.2 * std::sin(heading);
    line.push_vertex({.x_m = x + noise(random), .y_m = y + noise(random)});
  }
  return line;
}

double greatest_distance_m(const LineSet& line, const LineSet& kept) {
  double greatest2 = 0;
  for (const Vertex& v : line.vertices()) {
    double nearest2 = 1e18;
    for (std::size_t i = 1; i < kept.vertices().size(); ++i) {
      nearest2 = std::min(
          nearest2,
          Segment{kept.vertices()[i - 1].position(), kept.vertices()[i].position()}.distance2_m2(v.position()));
    }
    greatest2 = std::max(greatest2, nearest2);
  }
  return std::sqrt(greatest2);
}

TEST(Simplifier, dropped_vertices_stay_within_tolerance) {
  Simplifier simplifier({.tolerance_m = 0.10});
  for (unsigned seed = 0; seed < 200; ++seed) {
    const LineSet line = noisy_kerb(seed, 0.05);
    const LineSet& kept = simplifier.run_all(line);
    EXPECT_EQ(kept.vertices().front(), line.vertices().front());
    EXPECT_EQ(kept.vertices().back(), line.vertices().back());
    EXPECT_LE(greatest_distance_m(line, kept), 0.10 + 1e-12) << "seed " << seed;
  }
}

TEST(Simplifier, simplifying_twice_changes_nothing) {
  Simplifier once({.tolerance_m = 0.08}), again({.tolerance_m = 0.08});
  for (unsigned seed = 0; seed < 200; ++seed) {
    const LineSet first = once.run_all(noisy_kerb(seed, 0.03));
    const LineSet& second = again.run_all(first);
    // A vertex kept once splits the line where it bends most; what stays can only shrink when a split moved.
    EXPECT_LE(second.vertices().size(), first.vertices().size()) << "seed " << seed;
    EXPECT_LE(greatest_distance_m(first, second), 0.08 + 1e-12) << "seed " << seed;
  }
}

TEST(Simplifier, a_straight_line_keeps_its_ends_alone) {
  LineSet line;
  line.begin_line({});
  for (int i = 0; i < 50; ++i) line.push_vertex({.x_m = 0.3 * i, .y_m = 0.1 * i});
  Simplifier simplifier({.tolerance_m = 0.01});
  EXPECT_EQ(simplifier.run_all(line).vertices().size(), 2U);
}

TEST(Simplifier, a_corner_stays) {
  LineSet line;
  line.begin_line({});
  for (int i = 0; i <= 20; ++i) line.push_vertex({.x_m = 0.2 * i, .y_m = 0});
  for (int i = 1; i <= 20; ++i) line.push_vertex({.x_m = 4, .y_m = 0.2 * i});
  Simplifier simplifier({.tolerance_m = 0.05});
  const LineSet& kept = simplifier.run_all(line);
  ASSERT_EQ(kept.vertices().size(), 3U);
  EXPECT_EQ(kept.vertices()[1].position(), Eigen::Vector2d(4, 0));
}

TEST(Simplifier, keeps_attributes_and_tiny_lines) {
  LineSet lines;
  lines.begin_line({.kind = BoundaryKind::barrier, .height_m = 2});
  lines.push_vertex({.x_m = 1});
  lines.begin_line({.kind = BoundaryKind::curb});
  lines.push_vertex({.x_m = 1});
  lines.push_vertex({.x_m = 1});
  Simplifier simplifier({});
  const LineSet& kept = simplifier.run_all(lines);
  ASSERT_EQ(kept.lines().size(), 2U);
  EXPECT_EQ(kept.lines()[0].attributes, lines.lines()[0].attributes);
  EXPECT_EQ(kept.lines()[0].count, 1U);
  EXPECT_EQ(kept.lines()[1].count, 2U);
}

}  // namespace
}  // namespace roadvec
