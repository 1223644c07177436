#include "tools/simulate/city.h"

#include <gtest/gtest.h>

#include "tests/tools/simulate/made_drive.h"
#include "tests/tools/simulate/made_world.h"

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

}  // namespace
}  // namespace roadvec
