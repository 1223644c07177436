#include "tools/simulate/world.h"

#include <gtest/gtest.h>

#include "tools/simulate/random.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {
namespace {

/// A plateau 0.5 m high over x, y in [10, 20], a wall 3 m high at x = 30, a pole of 0.5 m radius at (0, 10).
World small_world() {
  std::vector<Face> faces;
  const std::vector<Eigen::Vector2d> outline_m{{10, -5}, {20, -5}, {20, 5}, {10, 5}};
  for (std::size_t i = 0; i < 4; ++i) {
    faces.push_back({outline_m[i], outline_m[(i + 1) % 4], 0.5, 0.5, Material::kerb, Material::sidewalk});
  }
  faces.push_back({{30, -50}, {30, 50}, 3.0, 0, Material::wall, Material::wall});
  return World::build(std::move(faces), {{{0, 10}, 0.5, 2.0, Material::pole}}).value();
}

Hit cast(const World& world, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return world.cast(from, (to - from).normalized(), 100);
}

TEST(World, a_beam_ends_on_the_first_surface_it_meets) {
  const World world = small_world();
  const Eigen::Vector3d eye(0, 0, 2);
  EXPECT_NEAR(cast(world, eye, {5, 0, 0}).range_m, std::hypot(5, 2), 1e-9);
  EXPECT_EQ(cast(world, eye, {5, 0, 0}).material, Material::road);
  EXPECT_NEAR(cast(world, eye, {10, 0, 0.25}).range_m, std::hypot(10, 1.75), 1e-9);
  EXPECT_EQ(cast(world, eye, {10, 0, 0.25}).material, Material::kerb);
  EXPECT_NEAR(cast(world, eye, {12, 0, 0.5}).range_m, std::hypot(12, 1.5), 1e-9);
  EXPECT_EQ(cast(world, eye, {12, 0, 0.5}).material, Material::sidewalk);
  EXPECT_EQ(cast(world, eye, {28, 0, 0.01}).material, Material::road) << "behind the plateau the ground is low again";
  EXPECT_NEAR(cast(world, eye, {30, 0, 1.9}).range_m, std::hypot(30, 0.1), 1e-9);
  EXPECT_EQ(cast(world, eye, {30, 0, 1.9}).material, Material::wall);
  EXPECT_EQ(cast(world, eye, {30, 0, 3.1}).face, Hit::kNothing);
  EXPECT_NEAR(cast(world, eye, {0, 10, 1.9}).range_m, 9.5 * std::hypot(10, 0.1) / 10, 1e-9);
  EXPECT_EQ(cast(world, eye, {0, 10, 1.9}).material, Material::pole);
}

TEST(World, heights_are_those_of_the_plateaus) {
  const World world = small_world();
  EXPECT_EQ(world.height_at({0, 0}), 0);
  EXPECT_EQ(world.height_at({15, 0}), 0.5);
  EXPECT_EQ(world.height_at({25, 0}), 0);
  EXPECT_EQ(world.height_at({5, 5}), 0);
}

/// What the grid does, done face by face.
double nearest_face_m(const World& world, const Eigen::Vector2d& from, const Eigen::Vector2d& step) {
  double nearest_m = 100;
  for (const Face& face : world.faces()) {
    const Eigen::Vector2d along = face.b_m - face.a_m, offset = face.a_m - from;
    const double across = step.x() * along.y() - step.y() * along.x();
    const double range_m = (offset.x() * along.y() - offset.y() * along.x()) / across;
    const double share = (offset.x() * step.y() - offset.y() * step.x()) / across;
    if (across != 0 && range_m > 0 && share >= 0 && share <= 1) nearest_m = std::min(nearest_m, range_m);
  }
  return nearest_m;
}

TEST(World, the_grid_finds_the_same_face_as_looking_at_all_of_them) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Random random(seed, 0);
    const auto place = [&] {
      return Eigen::Vector2d(std::round(80 * random.uniform()) / 2, std::round(80 * random.uniform()) / 2);
    };
    std::vector<Face> faces;
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d a_m = place(), b_m = place();
      if (a_m != b_m) faces.push_back({a_m, b_m, 10, 0, Material::wall, Material::wall});
    }
    const World world = World::build(std::move(faces), {}).value();
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector2d from(1 + 38 * random.uniform(), 1 + 38 * random.uniform());
      const double angle_rad = kTwoPi * random.uniform();
      const Eigen::Vector3d direction(std::cos(angle_rad), std::sin(angle_rad), 0);
      const Hit hit = world.cast({from.x(), from.y(), 1}, direction, 100);
      EXPECT_NEAR(hit.range_m, nearest_face_m(world, from, direction.head<2>()), 1e-9) << "seed " << seed;
    }
  }
}

TEST(World, a_crowd_in_one_cell_is_refused_with_the_place) {
  std::vector<Pole> poles(100, {{3, 4}, 0.1, 2, Material::pole});
  const auto world = World::build({}, std::move(poles));
  ASSERT_FALSE(world);
  EXPECT_NE(world.error().message.find("space them out"), std::string::npos);
}

TEST(BuiltWorld, gaps_open_the_kerb_and_the_sidewalk_behind_it) {
  Scene scene;
  scene.road.waypoints = {{{0, 0}, 0}, {{100, 0}, 0}};
  scene.road.width_m = 8;
  scene.road.sidewalk_m = 10;
  scene.road.gaps = {{Side::left, 50, 6, 2}, {Side::right, 30, 4, 0}};
  scene.parked_cars.push_back({.row = {Side::right, 70, 80}});
  const auto path = RoadPath::create(scene.road);
  const auto built = build_world(scene, *path);
  ASSERT_TRUE(built);
  const World& world = built->world;
  const double kerb_m = scene.road.kerb_height_m;
  EXPECT_EQ(world.height_at({20, 3.99}), 0);
  EXPECT_NEAR(world.height_at({20, 4.01}), kerb_m, 1e-12);
  EXPECT_NEAR(world.height_at({20, -4.01}), kerb_m, 1e-12);
  EXPECT_EQ(world.height_at({50, 8}), 0) << "the mouth on the left";
  EXPECT_NEAR(world.height_at({46.9, 8}), kerb_m, 1e-12);
  EXPECT_EQ(world.height_at({46.9, 4.05}), 0) << "its corner is rounded";
  EXPECT_EQ(world.height_at({30, -8}), 0) << "the driveway on the right";
  EXPECT_NEAR(world.height_at({30, 8}), kerb_m, 1e-12);
  EXPECT_NEAR(world.height_at({72, -3}), 1.5, 1e-12) << "a parked car";
  EXPECT_EQ(world.height_at({72, -1}), 0);
}

TEST(RoadPath, an_arc_rounds_a_corner_and_parallels_keep_their_distance) {
  RoadSpec road;
  road.waypoints = {{{0, 0}, 0}, {{50, 0}, 10}, {{50, 50}, 0}};
  const auto path = RoadPath::create(road);
  ASSERT_TRUE(path);
  EXPECT_NEAR(path->length_m(), 40 + 10 * kPi / 2 + 40, 1e-9);
  const PathPoint middle = path->at(40 + 10 * kPi / 4);
  EXPECT_NEAR((middle.position_m - Eigen::Vector2d(40, 10)).norm(), 10, 1e-9);
  EXPECT_NEAR(middle.heading_rad, kPi / 4, 1e-9);
  EXPECT_NEAR((path->beside(40 + 10 * kPi / 4, -3) - Eigen::Vector2d(40, 10)).norm(), 13, 1e-9);
}

TEST(RoadPath, a_parallel_inside_a_tight_corner_stays_on_its_side_of_both_legs) {
  RoadSpec road;
  road.waypoints = {{{0, 0}, 5}, {{60, 0}, 5}, {{60, 40}, 5}, {{0, 40}, 5}};
  road.closed = true;
  const auto path = RoadPath::create(road);
  ASSERT_TRUE(path);
  for (double s = 0; s < path->length_m(); s += 0.1) {
    const Eigen::Vector2d p = path->beside(s, 12);
    EXPECT_TRUE(p.x() > 12 - 1e-9 && p.x() < 48 + 1e-9 && p.y() > 12 - 1e-9 && p.y() < 28 + 1e-9)
        << s << ": " << p.transpose();
  }
}

TEST(RoadPath, arcs_that_do_not_fit_their_legs_are_refused) {
  RoadSpec road;
  road.waypoints = {{{0, 0}, 0}, {{10, 0}, 30}, {{10, 50}, 0}};
  EXPECT_FALSE(RoadPath::create(road));
}

TEST(RoadPath, a_corner_without_a_radius_is_refused) {
  RoadSpec road;
  road.waypoints = {{{0, 0}, 0}, {{50, 0}, 0}, {{50, 50}, 0}};
  const auto path = RoadPath::create(road);
  ASSERT_FALSE(path);
  EXPECT_NE(path.error().message.find("waypoint 1"), std::string::npos);
}

}  // namespace
}  // namespace roadvec
