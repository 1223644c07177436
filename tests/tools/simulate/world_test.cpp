#include "tools/simulate/world.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/angle.h"
#include "tests/tools/simulate/made_world.h"
#include "tools/simulate/random.h"

namespace roadvec {
namespace {

TEST(World, a_beam_ends_on_the_first_surface_it_meets) {
  const World world = world_of(kFlatRoad + R"(
[[road.wall]]
points_m = [[80, -3], [80, 3]]
[[road.pole]]
points_m = [[50, 20]]
radius_m = 0.5
height_m = 2
)")
                          .world;
  const Eigen::Vector3d eye(50, 0, 2);
  const Hit road = cast(world, eye, {55, 0, 0});
  EXPECT_NEAR(road.range_m, std::hypot(5, 2), 1e-4);
  EXPECT_EQ(road.material, Material::road);
  EXPECT_NEAR(road.cosine, 2 / std::hypot(5, 2), 1e-4);
  const Hit kerb = cast(world, eye, {50, 4, 0.06});
  EXPECT_NEAR(kerb.range_m, std::hypot(4, 1.94), 1e-4);
  EXPECT_EQ(kerb.material, Material::kerb);
  EXPECT_GE(kerb.face, 0);
  EXPECT_NEAR(cast(world, eye, {50, 5, 0.12}).range_m, std::hypot(5, 1.88), 1e-4);
  EXPECT_EQ(cast(world, eye, {50, 5, 0.12}).material, Material::sidewalk);
  EXPECT_EQ(cast(world, eye, {50, 9, 0.14}).material, Material::grass);
  EXPECT_NEAR(cast(world, eye, {80, 0, 1.9}).range_m, std::hypot(30, 0.1), 1e-6);
  EXPECT_EQ(cast(world, eye, {80, 0, 1.9}).material, Material::wall);
  EXPECT_EQ(cast(world, eye, {80, 0, 3.1}).face, Hit::kNothing);
  const Hit pole = cast(world, eye, {50, 20, 2.05});
  EXPECT_NEAR(pole.range_m, 19.5 * std::hypot(20, 0.05) / 20, 1e-6);
  EXPECT_EQ(pole.material, Material::pole);
}

TEST(World, from_behind_the_kerb_a_beam_comes_down_to_the_road) {
  const World world = world_of(kFlatRoad).world;
  const Hit hit = cast(world, {50, 7, 1}, {50, 0, 0});
  EXPECT_EQ(hit.material, Material::road);
  EXPECT_NEAR(hit.range_m, std::hypot(7, 1), 1e-3);
}

/// What the grid does, done face by face.
double nearest_face_m(const std::vector<Face>& faces, const Eigen::Vector2d& from, const Eigen::Vector2d& step) {
  double nearest_m = 100;
  for (const Face& face : faces) {
    const Eigen::Vector2d along = face.b_m - face.a_m, offset = face.a_m - from;
    const double across = step.x() * along.y() - step.y() * along.x();
    const double range_m = (offset.x() * along.y() - offset.y() * along.x()) / across;
    const double share = (offset.x() * step.y() - offset.y() * step.x()) / across;
    if (across != 0 && range_m > 0 && share >= 0 && share <= 1) nearest_m = std::min(nearest_m, range_m);
  }
  return nearest_m;
}

TEST(Scenery, the_grid_finds_the_same_face_as_looking_at_all_of_them) {
  constexpr double kSmooth[kMaterialCount] = {};
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Random random(seed, 0);
    const auto place = [&] {
      return Eigen::Vector2d(std::round(80 * random.uniform()) / 2, std::round(80 * random.uniform()) / 2);
    };
    Things things;
    for (int i = 0; i < 20; ++i) {
      Face face;
      face.a_m = place();
      face.b_m = place();
      face.top_m = 10;
      if (face.a_m != face.b_m) things.faces.push_back(face);
    }
    const std::vector<Face> faces = things.faces;
    const Scenery scenery =
        Scenery::build(Ground(Land(Scene{}), {}, 0, Material::grass), std::move(things), kSmooth).value();
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector2d from(1 + 38 * random.uniform(), 1 + 38 * random.uniform());
      const double angle_rad = kTwoPi * random.uniform();
      const Eigen::Vector3d direction(std::cos(angle_rad), std::sin(angle_rad), 0);
      const Beam beam{{from.x(), from.y(), 1}, direction};
      Hit hit{.range_m = 100};
      scenery.cast({&beam, 1}, 0, {&hit, 1});
      EXPECT_NEAR(hit.range_m, nearest_face_m(faces, from, direction.head<2>()), 1e-9) << "seed " << seed;
    }
  }
}

TEST(Scenery, beams_cast_together_meet_what_each_meets_by_itself) {
  for (const char* const name : {"scene_b", "downtown"}) {
    auto scene = load_scene(name).value();
    std::fill(std::begin(scene.roughness_m), std::end(scene.roughness_m), 0.0);
    const World world = build_world(scene).value().world;
    const RoadPath route = route_of(scene).value();
    Random random(1, 0);
    int count = 0, nothing_count = 0, edge_count = 0, other_count = 0;
    for (int i = 0; i < 20'000; ++i) {
      const Eigen::Vector2d place_m =
          route.beside(scene.car.start_m + random.uniform() * scene.car.distance_m, scene.car.lane_m);
      const double azimuth_rad = kTwoPi * random.uniform(), elevation_rad = rad_from_deg(2 - 20 * random.uniform());
      const double c = std::cos(elevation_rad), s = std::sin(elevation_rad);
      const Eigen::Vector3d ahead(c * std::cos(azimuth_rad), c * std::sin(azimuth_rad), s);
      const Eigen::Vector3d aside(1e-3 * (2 * random.uniform() - 1), 1e-3 * (2 * random.uniform() - 1),
                                  1e-3 * (2 * random.uniform() - 1));
      const Eigen::Vector3d eye_m(place_m.x(), place_m.y(), world.height_at(place_m) + 1.73);
      const std::array<Beam, 3> beams{{{eye_m, ahead}, {eye_m + aside, ahead + aside}, {eye_m - aside, ahead - aside}}};
      World::Moment moment;
      world.look(5, place_m, 100, moment);
      std::array<Hit, 3> together;
      together.fill({.range_m = 100});
      world.cast(moment, beams, 0, together);
      for (std::size_t k = 0; k < beams.size(); ++k) {
        const Hit alone = world.cast(beams[k].origin_m, beams[k].direction, 100, 5);
        // Two squares of ground may differ by what an even one leaves out.
        const bool same = alone.face == together[k].face && alone.material == together[k].material &&
                          std::abs(alone.range_m - together[k].range_m) * (alone.cosine + 1e-3) < 0.003;
        other_count += same ? 0 : 1;
        nothing_count += alone.face == Hit::kNothing ? 1 : 0;
        edge_count += alone.face != together[0].face ? 1 : 0;
        ++count;
      }
    }
    EXPECT_LT(other_count, 0.001 * count) << name;
    EXPECT_GT(edge_count, 0.01 * count) << "beams that are split tell whether all three are cast";
    EXPECT_GT(nothing_count, 100);
  }
}

TEST(Ground, the_crown_falls_from_the_middle_to_both_kerbs) {
  const World world = world_of("[[road]]\nwaypoints = [[0, 0], [100, 0]]\nwidth_m = 8\ncrown_percent = 2.5\n").world;
  for (const double y_m : {-3.9, -2.3, -1.0, 1.4, 3.1}) {
    EXPECT_NEAR(world.height_at({50, y_m}), 0.025 * (4 - std::abs(y_m)), 1e-4) << y_m;
  }
  EXPECT_NEAR(world.height_at({50, 4.1}), 0.12 + 0.002, 1e-4) << "the sidewalk rises 2 % from the kerb's top";
  EXPECT_NEAR(world.height_at({50, -6}), 0.12 + 0.04, 1e-4);
}

TEST(Ground, the_land_slopes_and_has_hills_and_the_road_lies_on_it) {
  const World world = world_of(kFlatRoad + R"(
[land]
slope_percent = 5
[[hill]]
at_m = [[60, 0]]
height_m = 4
along_m = 20
across_m = 500
)")
                          .world;
  EXPECT_NEAR(world.height_at({60, 0}), 3 + 4, 0.01);
  EXPECT_NEAR(world.height_at({20, 0}), 1 + 4 * std::exp(-2.0), 0.01);
  EXPECT_EQ(cast(world, {30, 0, world.height_at({30, 0}) + 1.7}, {60, 0, world.height_at({60, 0})}).face, Hit::kGround);
  const Hit hidden = cast(world, {30, 0, world.height_at({30, 0}) + 0.3}, {90, 0, world.height_at({90, 0})});
  EXPECT_LT(hidden.range_m, 40) << "the crest hides the road behind it";
}

TEST(Edges, crossing_roads_open_into_each_other_with_rounded_corners) {
  const World world = world_of("corner_radius_m = 4\n" + kFlatRoad + R"(
[[road]]
waypoints = [[50, -40], [50, 40]]
width_m = 6
)")
                          .world;
  const Scenery& scenery = world.scenery(0);
  EXPECT_TRUE(scenery.on_road({50, 20}));
  EXPECT_TRUE(scenery.on_road({50, -4.5}));
  EXPECT_FALSE(scenery.on_road({45.5, 20}));
  EXPECT_FALSE(scenery.on_road({40, 4.5}));
  // The corner between the kerbs y = 4 and x = 53; the circle's middle is at (57, 8).
  EXPECT_TRUE(scenery.on_road({53.5, 4.5}));
  const double inside_m = 4.01 / std::sqrt(2.0), outside_m = 3.99 / std::sqrt(2.0);
  EXPECT_TRUE(scenery.on_road({57 - inside_m, 8 - inside_m}));
  EXPECT_FALSE(scenery.on_road({57 - outside_m, 8 - outside_m}));
}

TEST(Edges, on_road_is_right_everywhere_beside_a_straight_road_and_at_its_ends) {
  const World world = world_of(kFlatRoad).world;
  Random random(1, 0);
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector2d p(-5 + 110 * random.uniform(), -6 + 12 * random.uniform());
    EXPECT_EQ(world.scenery(0).on_road(p), p.x() > 0 && p.x() < 100 && std::abs(p.y()) < 4) << p.transpose();
  }
}

TEST(Edges, an_island_stands_in_the_road) {
  const BuiltWorld built = world_of(kFlatRoad + R"(
[[island]]
points_m = [[40, -1], [60, -1], [60, 1], [40, 1]]
kerb_height_m = 0.15
)");
  EXPECT_NEAR(built.world.height_at({50, 0}), 0.15, 1e-3);
  const Hit hit = cast(built.world, {50, -3.5, 1.7}, {50, -1, 0.07});
  ASSERT_GE(hit.face, 0);
  EXPECT_EQ(hit.material, Material::kerb);
  EXPECT_EQ(built.truth[static_cast<std::size_t>(hit.face)].kind, "curb");
  EXPECT_NEAR(built.truth[static_cast<std::size_t>(hit.face)].height_m, 0.15, 1e-9);
  EXPECT_NEAR(built.truth[static_cast<std::size_t>(hit.face)].a_m.y(), -1, 1e-3);
}

TEST(Edges, a_driveway_drops_the_kerb_with_a_ramp_on_both_sides) {
  const BuiltWorld built = world_of(kFlatRoad + "[[road.driveway]]\nat_m = 50\nwidth_m = 4\nheight_m = 0.03\n");
  const auto kerb_m = [&](double x_m) { return built.world.height_at({x_m, -4.05}); };
  EXPECT_NEAR(kerb_m(50), 0.03, 2e-3);
  EXPECT_NEAR(kerb_m(48.3), 0.03, 2e-3);
  EXPECT_NEAR(kerb_m(47.5), 0.075, 0.01);
  EXPECT_NEAR(kerb_m(46.5), 0.12, 2e-3);
  for (const TruthPiece& piece : built.truth) {
    const Eigen::Vector2d middle_m = (piece.a_m + piece.b_m) / 2;
    const bool dropped = middle_m.y() < 0 && std::abs(middle_m.x() - 50) < 1.7;
    if (dropped || middle_m.y() > 0) {
      EXPECT_NEAR(piece.height_m, dropped ? 0.03 : 0.12, 1e-9) << middle_m.transpose();
    }
  }
}

TEST(Edges, a_verge_has_no_kerb_and_is_grass) {
  const BuiltWorld built = world_of(kFlatRoad + "[[road.verge]]\nfrom_m = 20\nto_m = 80\n");
  EXPECT_NEAR(built.world.height_at({50, -4.01}), 0, 1e-3);
  EXPECT_LT(built.world.height_at({50, -6}), -0.05);
  EXPECT_EQ(cast(built.world, {50, 0, 2}, {50, -5, -0.04}).material, Material::grass);
  int verge_count = 0;
  for (const TruthPiece& piece : built.truth) {
    const bool verge = piece.a_m.y() < 0 && piece.a_m.x() > 21 && piece.a_m.x() < 79;
    EXPECT_EQ(piece.kind == "unknown", verge || (piece.kind == "unknown" && piece.height_m == 0));
    verge_count += verge ? 1 : 0;
  }
  EXPECT_GT(verge_count, 100);
}

TEST(Edges, truth_lies_where_the_kerbs_face_meets_the_road) {
  const BuiltWorld built = world_of(kFlatRoad + "[[road.mouth]]\nat_m = 50\nwidth_m = 6\n");
  ASSERT_GT(built.truth.size(), 200U);
  for (const TruthPiece& piece : built.truth) {
    const Eigen::Vector2d middle_m = (piece.a_m + piece.b_m) / 2, leg = (piece.b_m - piece.a_m).normalized();
    const Eigen::Vector2d to_road(leg.y(), -leg.x());
    if (middle_m.x() < 1 || middle_m.x() > 99 || middle_m.y() < -23) continue;  // the ends of the world
    const Eigen::Vector2d from_m = middle_m + 1.5 * to_road, foot_m = middle_m + 0.01 * to_road;
    ASSERT_TRUE(built.world.scenery(0).on_road(foot_m)) << middle_m.transpose();
    ASSERT_FALSE(built.world.scenery(0).on_road(middle_m - 0.01 * to_road)) << middle_m.transpose();
    const Hit hit = cast(built.world, {from_m.x(), from_m.y(), 0.3}, {middle_m.x(), middle_m.y(), 0.05});
    EXPECT_NEAR(hit.range_m, std::hypot(1.5, 0.25), 0.01) << middle_m.transpose();
  }
}

TEST(Edges, a_bulge_narrows_the_road_and_a_bay_widens_it) {
  const World world = world_of(kFlatRoad + R"(
[[road.bulge]]
from_m = 20
to_m = 30
depth_m = 1.5
[[road.bulge]]
side = "left"
from_m = 60
to_m = 70
depth_m = -2
)")
                          .world;
  EXPECT_FALSE(world.scenery(0).on_road({25, -2.6}));
  EXPECT_TRUE(world.scenery(0).on_road({25, -2.4}));
  EXPECT_TRUE(world.scenery(0).on_road({65, 5.9}));
  EXPECT_FALSE(world.scenery(0).on_road({65, 6.1}));
  EXPECT_FALSE(world.scenery(0).on_road({55, 4.1}));
}

TEST(Edges, a_rounded_kerb_meets_high_beams_farther_back) {
  const std::string text =
      "[[road]]\nwaypoints = [[0, 0], [100, 0]]\nwidth_m = 8\ncrown_percent = 0\nkerb_round_m = 0.04\n";
  const World world = world_of(text).world;
  const auto back_m = [&](double z_m) {
    const Hit hit = world.cast({50, 0, z_m}, {0, 1, 0}, 20);
    return hit.range_m - 4;
  };
  EXPECT_NEAR(back_m(0.05), 0, 1e-4);
  EXPECT_NEAR(back_m(0.08 + 0.04 * 0.8), 0.04 * 0.4, 1e-3);
}

TEST(Things, beams_pass_below_a_parked_car_and_between_its_wheels) {
  const World world = world_of(kFlatRoad + "[[road.parked_cars]]\nfrom_m = 48\nto_m = 53\n").world;
  const double x_m = 48 + 2.2;
  const Hit under = cast(world, {x_m, 0, 0.2}, {x_m, -4, 0.1});
  EXPECT_EQ(under.material, Material::kerb);
  EXPECT_EQ(cast(world, {x_m, 0, 0.5}, {x_m, -4, 0.5}).material, Material::car);
  EXPECT_NEAR(cast(world, {x_m, 0, 0.5}, {x_m, -4, 0.5}).range_m, 4 - 0.25 - 1.8, 1e-6);
  EXPECT_EQ(cast(world, {x_m, 0, 1.1}, {x_m, -4, 1.1}).material, Material::glass);
  EXPECT_EQ(cast(world, {x_m + 0.3 * 4.4, 0, 0.1}, {x_m + 0.3 * 4.4, -4, 0.1}).material, Material::car) << "a wheel";
}

TEST(Things, leaves_of_a_hedge_are_rough_and_stay_where_they_are) {
  const World world = world_of(kFlatRoad + "[[road.hedge]]\nside = \"left\"\nsetback_m = 2\nporous_m = 0.4\n").world;
  double least_m = 100, most_m = 0;
  for (double x_m = 30; x_m < 60; x_m += 0.37) {
    const Hit hit = cast(world, {x_m, 0, 0.8}, {x_m, 10, 0.8});
    EXPECT_EQ(hit.range_m, cast(world, {x_m, 0, 0.8}, {x_m, 10, 0.8}).range_m);
    if (hit.material != Material::hedge) continue;
    least_m = std::min(least_m, hit.range_m);
    most_m = std::max(most_m, hit.range_m);
  }
  EXPECT_NEAR(least_m, 6, 0.02);
  EXPECT_GT(most_m, 6.2);
  EXPECT_LT(most_m, 6.41);
}

TEST(Things, a_fence_lets_a_share_of_the_beams_through) {
  const World world = world_of(kFlatRoad + "[[road.fence]]\nside = \"left\"\nsetback_m = 2\n").world;
  int met = 0;
  for (int i = 0; i < 1000; ++i)
    met += cast(world, {30 + 0.0307 * i, 0, 0.6}, {30 + 0.0307 * i, 7, 0.6}).material == Material::fence;
  EXPECT_NEAR(met, 550, 60);
}

TEST(Things, a_guard_rail_is_open_below) {
  const World world = world_of(kFlatRoad + "[[road.guard_rail]]\nside = \"left\"\n").world;
  EXPECT_EQ(cast(world, {51.3, 0, 0.75}, {51.3, 4.5, 0.75}).material, Material::metal);
  EXPECT_NE(cast(world, {51.3, 0, 0.45}, {51.3, 4.5, 0.4}).material, Material::metal);
}

TEST(Things, walls_keep_off_side_streets_and_stay_open_at_driveways) {
  const BuiltWorld built = world_of(kFlatRoad + R"(
[[road.wall]]
[[road.mouth]]
at_m = 30
[[road.driveway]]
at_m = 70
)");
  int wall_count = 0;
  for (const TruthPiece& piece : built.truth) {
    if (piece.kind != "barrier") continue;
    ++wall_count;
    const double x_m = (piece.a_m.x() + piece.b_m.x()) / 2;
    EXPECT_GT(std::abs(x_m - 30), 3.5 + 2.0);
    EXPECT_GT(std::abs(x_m - 70), 2.0);
  }
  EXPECT_GT(wall_count, 60);
}

TEST(Movers, a_car_is_where_its_speed_has_brought_it_and_beams_meet_it_there) {
  const World world = world_of(kFlatRoad + R"(
[[mover]]
kind = "car"
waypoints = [[0, 0], [100, 0]]
lane_m = 2
speed_mps = 5
start_s = 2
)")
                          .world;
  EXPECT_TRUE(world.movers().at(1.9).empty());
  const auto there = world.movers().at(6);
  ASSERT_EQ(there.size(), 1U);
  EXPECT_NEAR((there[0].centre_m - Eigen::Vector2d(20, 2)).norm(), 0, 1e-9);
  const Hit hit = cast(world, {20, -3, 0.5}, {20, 2, 0.5}, 6);
  EXPECT_EQ(hit.material, Material::car);
  EXPECT_NEAR(hit.range_m, 5 - 0.9, 1e-9);
  EXPECT_NE(cast(world, {20, -3, 0.5}, {20, 2, 0.5}, 10).material, Material::car);
  EXPECT_TRUE(world.movers().at(23).empty()) << "it has left at the line's end";
}

TEST(World, the_scenes_change_takes_a_wall_away_and_moves_a_kerb) {
  const BuiltWorld built = world_of("change_s = 10\n" + kFlatRoad + R"(
[[road.wall]]
side = "left"
when = "before"
from_m = 40
to_m = 60
[[road.bulge]]
from_m = 40
to_m = 60
when = "after"
)");
  EXPECT_EQ(cast(built.world, {50, 0, 1}, {50, 8, 1}, 9.9).material, Material::wall);
  EXPECT_NE(cast(built.world, {50, 0, 1}, {50, 8, 1}, 10.1).material, Material::wall);
  EXPECT_TRUE(built.world.scenery(9.9).on_road({50, -3}));
  EXPECT_FALSE(built.world.scenery(10.1).on_road({50, -3}));
  double gone_m = 0, new_m = 0;
  for (const TruthPiece& piece : built.truth) {
    const double length_m = (piece.b_m - piece.a_m).norm();
    if (piece.gone) gone_m += length_m;
    if (piece.phase == 1 && piece.earlier < 0) new_m += length_m;
  }
  EXPECT_NEAR(gone_m, 20 + 20 + 2 * 1.5, 1.1) << "the wall, and the kerb behind the bulge";
  EXPECT_NEAR(new_m, 20 + 2 * 1.5 * std::sqrt(2.0), 1.1);
}

}  // namespace
}  // namespace roadvec
