#include "tools/simulate/road_path.h"

#include <gtest/gtest.h>

#include "core/base/angle.h"

namespace roadvec {
namespace {

TEST(RoadPath, an_arc_rounds_a_corner_and_parallels_keep_their_distance) {
  const auto path = RoadPath::create({{{0, 0}, 0}, {{50, 0}, 10}, {{50, 50}, 0}}, false);
  ASSERT_TRUE(path);
  EXPECT_NEAR(path->length_m(), 40 + 10 * kPi / 2 + 40, 1e-9);
  const PathPoint middle = path->at(40 + 10 * kPi / 4);
  EXPECT_NEAR((middle.position_m - Eigen::Vector2d(40, 10)).norm(), 10, 1e-9);
  EXPECT_NEAR(middle.heading_rad, kPi / 4, 1e-9);
  EXPECT_NEAR((path->beside(40 + 10 * kPi / 4, -3) - Eigen::Vector2d(40, 10)).norm(), 13, 1e-9);
}

TEST(RoadPath, the_nearest_place_of_a_point_beside_the_line_is_where_it_was_put) {
  for (const bool closed : {false, true}) {
    const auto path = RoadPath::create({{{0, 0}, 8}, {{60, 5}, 12}, {{50, 60}, 9}, {{5, 50}, 7}}, closed).value();
    for (double s = 0.3; s < path.length_m(); s += 0.7) {
      for (const double left_m : {-4.0, 0.5, 3.0}) {
        const PathPlace place = path.nearest(path.beside(s, left_m));
        EXPECT_NEAR(place.station_m, s, 1e-6) << left_m;
        EXPECT_NEAR(place.left_m, left_m, 1e-9) << s;
      }
    }
  }
}

TEST(RoadPath, off_an_open_lines_ends_stations_go_on) {
  const auto path = RoadPath::create({{{0, 0}, 0}, {{50, 0}, 0}}, false).value();
  EXPECT_NEAR(path.nearest({-3, 2}).station_m, -3, 1e-12);
  EXPECT_NEAR(path.nearest({57, -2}).station_m, 57, 1e-12);
  EXPECT_NEAR(path.nearest({57, -2}).left_m, -2, 1e-12);
}

TEST(RoadPath, a_parallel_inside_a_tight_corner_stays_on_its_side_of_both_legs) {
  const auto path = RoadPath::create({{{0, 0}, 5}, {{60, 0}, 5}, {{60, 40}, 5}, {{0, 40}, 5}}, true);
  ASSERT_TRUE(path);
  for (double s = 0; s < path->length_m(); s += 0.1) {
    const Eigen::Vector2d p = path->beside(s, 12);
    EXPECT_TRUE(p.x() > 12 - 1e-9 && p.x() < 48 + 1e-9 && p.y() > 12 - 1e-9 && p.y() < 28 + 1e-9)
        << s << ": " << p.transpose();
  }
}

TEST(RoadPath, arcs_that_do_not_fit_their_legs_are_refused) {
  EXPECT_FALSE(RoadPath::create({{{0, 0}, 0}, {{10, 0}, 30}, {{10, 50}, 0}}, false));
}

TEST(RoadPath, a_corner_without_a_radius_is_refused) {
  const auto path = RoadPath::create({{{0, 0}, 0}, {{50, 0}, 0}, {{50, 50}, 0}}, false);
  ASSERT_FALSE(path);
  EXPECT_NE(path.error().message.find("waypoint 1"), std::string::npos);
}

}  // namespace
}  // namespace roadvec
