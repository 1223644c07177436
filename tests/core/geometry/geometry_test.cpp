#include <gtest/gtest.h>

#include <random>

#include "core/geometry/line_set.h"
#include "core/geometry/path.h"
#include "core/geometry/pose2.h"
#include "core/geometry/segment.h"

namespace roadvec {
namespace {

TEST(Pose2, times_its_inverse_is_identity) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> metres(-1e4, 1e4), angle(-kPi, kPi);
  for (int i = 0; i < 200; ++i) {
    const Pose2 T{metres(random), metres(random), angle(random)};
    const Pose2 identity = T * T.inverse();
    EXPECT_NEAR(identity.x_m, 0, 1e-9);
    EXPECT_NEAR(identity.y_m, 0, 1e-9);
    EXPECT_NEAR(identity.theta_rad, 0, 1e-12);
  }
}

TEST(Pose2, composes_as_points_do) {
  const Pose2 a{3, -2, 0.7}, b{-1, 5, -2.9};
  const Eigen::Vector2d p(4, 9);
  EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-12);
}

TEST(Segment, nearest_point_stays_within_the_segment) {
  const Segment segment{{0, 0}, {10, 0}};
  EXPECT_EQ(segment.nearest({5, 3}), Eigen::Vector2d(5, 0));
  EXPECT_EQ(segment.nearest({-5, 3}), Eigen::Vector2d(0, 0));
  EXPECT_EQ(segment.nearest({50, 3}), Eigen::Vector2d(10, 0));
  const Segment point{{2, 2}, {2, 2}};
  EXPECT_EQ(point.nearest({5, 5}), Eigen::Vector2d(2, 2));
}

TEST(Path, is_linear_between_stops_and_turns_the_short_way) {
  Path path;
  path.push({0}, {0, 0, 3.1});
  path.push({1'000'000'000}, {10, -4, -3.1});
  const Pose2 middle = path.at({500'000'000});
  EXPECT_NEAR(middle.x_m, 5, 1e-12);
  EXPECT_NEAR(middle.y_m, -2, 1e-12);
  EXPECT_NEAR(std::abs(middle.theta_rad), kPi, 1e-9);
  EXPECT_NEAR(path.at({1'500'000'000}).x_m, 15, 1e-12);
}

TEST(Path, a_copy_takes_as_many_stops_as_the_original) {
  const Path original(3);
  Path copy(original);
  for (const int x : {0, 1, 2}) copy.push({x}, {static_cast<double>(x), 0, 0});
  EXPECT_EQ(copy.start().T_odom_vehicle.x_m, 0);
  EXPECT_EQ(copy.end().T_odom_vehicle.x_m, 2);
}

TEST(Path, keeps_its_newest_stop_when_full) {
  Path path(3);
  for (int i = 0; i < 10; ++i) path.push({i}, {static_cast<double>(i), 0, 0});
  EXPECT_EQ(path.end().time.ns, 9);
  EXPECT_EQ(path.start().time.ns, 0);
}

TEST(LineSet, dropping_the_last_line_gives_its_vertices_back) {
  LineSet lines;
  lines.begin_line({});
  lines.push_vertex({.x_m = 1});
  lines.begin_line({});
  lines.push_vertex({.x_m = 2});
  lines.drop_last_line();
  ASSERT_EQ(lines.lines().size(), 1U);
  EXPECT_EQ(lines.vertices().size(), 1U);
  EXPECT_EQ(lines.vertices_of(lines.lines()[0])[0].x_m, 1);
}

}  // namespace
}  // namespace roadvec
