#include "tools/simulate/city.h"

#include <gtest/gtest.h>

#include "tests/tools/simulate/made_drive.h"
#include "tests/tools/simulate/made_world.h"
#include "tools/simulate/picture.h"

namespace roadvec {
namespace {

TEST(City, the_same_seed_gives_the_same_town_and_another_seed_another) {
  EXPECT_EQ(city_scene(3, 0.5).value(), city_scene(3, 0.5).value());
  EXPECT_NE(city_scene(3, 0.5).value(), city_scene(4, 0.5).value());
}

TEST(City, it_is_a_scene_of_the_length_asked_for_with_life_along_the_drive) {
  for (const double length_km : {0.5, 3.0}) {
    const auto scene = parse_scene(city_scene(1, length_km).value(), "city");
    ASSERT_TRUE(scene) << scene.error().message;
    EXPECT_NEAR(scene->car.distance_m, 1000 * length_km, 1e-9);
    EXPECT_GE(route_of(*scene).value().length_m(), scene->car.start_m + scene->car.distance_m);
    EXPECT_GE(static_cast<double>(scene->movers.size()), 3 * length_km);
  }
}

TEST(City, its_streets_have_walls_and_kerbs_beside_the_drive) {
  const BuiltWorld built = world_of(city_scene(2, 0.5).value());
  double barrier_m = 0, curb_m = 0, parked_m = 0;
  for (const TruthPiece& piece : built.truth) {
    const double length_m = (piece.b_m - piece.a_m).norm();
    (piece.kind == "barrier" ? barrier_m : piece.kind == "curb" ? curb_m : parked_m) += length_m;
  }
  EXPECT_GT(curb_m, 1000);
  EXPECT_GT(barrier_m, 300);
  EXPECT_GT(parked_m, 50);
}

TEST(Picture, it_shows_the_kerbs_the_walls_and_the_way_and_stays_small) {
  const auto scene = load_scene("street");
  const auto picture = picture_of(scene.value());
  ASSERT_TRUE(picture) << picture.error().message;
  EXPECT_LT(picture->size(), 40'000U);
  EXPECT_EQ(picture->substr(0, 4), "<svg");
  for (const char* const stroke : {"#555", "#8a4b2a", "#c00"}) EXPECT_NE(picture->find(stroke), std::string::npos);
}

TEST(Picture, every_shipped_scene_has_one_beside_it_of_the_same_world) {
  for (const ShippedScene& shipped : shipped_scenes()) {
    const std::string name(shipped.name), drawn = picture_of(load_scene(name).value()).value();
    const std::string kept = bytes_of(std::string(ROADVEC_SOURCE "/tools/simulate/scenes/") + name + ".svg");
    // As far as the roads and what stands along them reach; the rest may differ by rounding.
    EXPECT_EQ(kept.substr(0, kept.find('\n')), drawn.substr(0, drawn.find('\n')))
        << "draw it again: roadvec-simulate " << name << " --picture tools/simulate/scenes/" << name << ".svg";
    EXPECT_LT(kept.size(), 40'000U) << name;
  }
}

}  // namespace
}  // namespace roadvec
