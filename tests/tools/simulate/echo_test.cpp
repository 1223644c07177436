#include "tools/simulate/echo.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace roadvec {
namespace {

constexpr double kNothing_m = std::numeric_limits<double>::infinity();

Echoes echoes(std::vector<SubRay> parts) { return echoes_of(parts); }

TEST(Echo, parts_closer_than_a_metre_make_one_return_in_mid_air) {
  const Echoes mixed = echoes({{10.0, 0.4, 0.5, 1}, {10.6, 0.4, 0.25, 2}, {10.6, 0.4, 0.25, 2}});
  ASSERT_EQ(mixed.count, 1U);
  EXPECT_GT(mixed.list[0].range_m, 10.25);
  EXPECT_LT(mixed.list[0].range_m, 10.35);
}

TEST(Echo, the_brighter_side_draws_a_mixed_return_towards_itself) {
  const double even_m = echoes({{10.0, 0.4, 0.5, 1}, {10.6, 0.4, 0.5, 2}}).list[0].range_m;
  EXPECT_LT(echoes({{10.0, 0.8, 0.5, 1}, {10.6, 0.1, 0.5, 2}}).list[0].range_m, even_m - 0.1);
}

TEST(Echo, parts_farther_apart_come_back_as_echoes_of_their_own_nearest_first) {
  const Echoes two = echoes({{14.0, 0.4, 0.25, 2}, {10.0, 0.4, 0.5, 1}, {14.1, 0.4, 0.25, 2}});
  ASSERT_EQ(two.count, 2U);
  EXPECT_EQ(two.list[0].range_m, 10.0);
  EXPECT_EQ(two.list[0].face, 1);
  EXPECT_NEAR(two.list[1].range_m, 14.05, 0.01);
  EXPECT_GT(two.list[0].power, two.list[1].power);
}

TEST(Echo, what_meets_nothing_takes_its_share_of_the_light_with_it) {
  const Echoes part = echoes({{10.0, 0.4, 0.5, 1}, {kNothing_m, 0, 0.25}, {kNothing_m, 0, 0.25}});
  const Echoes whole = echoes({{10.0, 0.4, 1.0, 1}});
  ASSERT_EQ(part.count, 1U);
  EXPECT_NEAR(part.list[0].power, whole.list[0].power / 2, 1e-12);
  EXPECT_EQ(echoes({{kNothing_m, 0, 1}}).count, 0U);
}

TEST(Echo, one_surface_smeared_in_range_is_one_echo_and_a_weaker_one) {
  const Echoes smeared = echoes({{38.5, 0.05, 0.25, -2}, {40.0, 0.05, 0.5, -2}, {41.6, 0.05, 0.25, -2}});
  ASSERT_EQ(smeared.count, 1U);
  EXPECT_NEAR(smeared.list[0].range_m, 40.0, 0.2);
  EXPECT_LT(smeared.list[0].power, 0.5 * echoes({{40.0, 0.05, 1.0, -2}}).list[0].power);
}

TEST(Echo, the_makers_ranges_are_where_echoes_are_just_heard) {
  EXPECT_NEAR(echoes({{50, 0.1, 1, 0}}).list[0].power, 1, 0.02);
  EXPECT_NEAR(echoes({{120, 0.8, 1, 0}}).list[0].power, 1, 0.02);
}

TEST(Echo, rough_ground_stays_bright_at_flat_angles_and_smooth_surfaces_do_not) {
  const Surface rough{.reflectivity = 0.2, .roughness_rad = 0.5}, smooth{.reflectivity = 0.2};
  EXPECT_NEAR(brightness(smooth, 1.0), 0.2, 1e-12);
  EXPECT_NEAR(brightness(smooth, 0.05), 0.01, 1e-12);
  EXPECT_GT(brightness(rough, 0.05), 0.05);
}

TEST(Echo, a_wet_road_is_heard_less_far_than_a_dry_one) {
  const auto farthest_m = [](double wet) {
    Scene scene;
    scene.lidar.wet = wet;
    const Surface road = surfaces_of(scene)[static_cast<std::size_t>(Material::road)];
    double range_m = 2;
    while (echoes({{range_m, brightness(road, 1.7 / range_m), 1, -2}}).list[0].power > 1) range_m += 0.5;
    return range_m;
  };
  EXPECT_GT(farthest_m(0), 30);
  EXPECT_LT(farthest_m(0.5), 0.9 * farthest_m(0));
  EXPECT_LT(farthest_m(1), 0.6 * farthest_m(0));
}

TEST(Echo, a_pane_answers_only_when_it_is_met_straight_on) {
  const Surface pane{.reflectivity = 0.05, .gloss = 1, .clear = 0.9};
  const auto power = [&](double cosine) {
    const Echoes list = echoes({{20, brightness(pane, cosine), 1, 3}});
    return list.count == 0 ? 0 : list.list[0].power;
  };
  EXPECT_GT(power(1.0), 1);
  EXPECT_LT(power(0.9), 0.5);
  const Surface gone{.clear = 1};
  EXPECT_EQ(echoes({{20, brightness(gone, 1.0), 1, 3}}).count, 0U);
}

}  // namespace
}  // namespace roadvec
