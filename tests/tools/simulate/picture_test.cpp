#include "tools/simulate/picture.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/tools/simulate/made_drive.h"
#include "tests/tools/simulate/made_world.h"

namespace roadvec {
namespace {

/// One class of things: a path of the picture, its lines' beginnings in units.
struct Drawn {
  std::vector<Eigen::Vector2d> begins;
};

/// By the colour that it is drawn in.
std::map<std::string, Drawn> classes_of(const std::string& picture) {
  std::map<std::string, Drawn> classes;
  std::istringstream lines(picture);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("<path ")) continue;
    Drawn& drawn = classes[line.substr(line.find('#'), line.find('"', line.find('#')) - line.find('#'))];
    for (std::size_t at = line.find('M'); at != std::string::npos; at = line.find('M', at + 1)) {
      std::istringstream place(line.substr(at + 1, 24));
      Eigen::Vector2d begin;
      place >> begin.x() >> begin.y();
      drawn.begins.push_back(begin);
    }
  }
  return classes;
}

constexpr const char *kRoads = "#cfd2d6", *kVerges = "#7a9a4a", *kKerbs = "#555", *kWalls = "#8a4b2a",
                     *kHedges = "#2f7d32", *kGone = "#d33", *kCars = "#8fa3c7", *kPoles = "#444", *kMovers = "#e08a00",
                     *kWay = "#c00";

TEST(Picture, it_shows_each_thing_once_in_the_colour_of_its_class_and_where_it_is) {
  const std::string text = kFlatRoad + R"(
[[road.verge]]
side = "left"
from_m = 70
to_m = 90
[[road.pole]]
points_m = [[20, 6], [40, 6], [60, 6], [80, 6]]
[[road.parked_cars]]
from_m = 30
to_m = 45
[[road.wall]]
points_m = [[10, 12], [30, 12]]
[[road.wall]]
points_m = [[50, 12], [60, 12], [60, 20]]
when = "before"
[[road.hedge]]
points_m = [[10, -12], [30, -12]]
[[mover]]
kind = "pedestrian"
waypoints = [[0, 5], [100, 5]]
[[mover]]
kind = "cyclist"
waypoints = [[0, 2], [100, 2]]
start_s = 1000
[car]
distance_m = 60
)";
  auto scene = parse_scene("change_s = 5\n" + text, "made.toml");
  ASSERT_TRUE(scene) << scene.error().message;
  const std::string picture = picture_of(*scene).value();
  auto classes = classes_of(picture);
  EXPECT_EQ(classes[kRoads].begins.size(), 1U);
  EXPECT_GE(classes[kKerbs].begins.size(), 3U) << "the right one, and what the verge leaves of the left one";
  EXPECT_EQ(classes[kVerges].begins.size(), 1U);
  EXPECT_EQ(classes[kWalls].begins.size(), 1U);
  EXPECT_EQ(classes[kGone].begins.size(), 1U);
  EXPECT_EQ(classes[kHedges].begins.size(), 1U);
  EXPECT_EQ(classes[kPoles].begins.size(), 4U);
  EXPECT_EQ(classes[kCars].begins.size(), 2U) << "of 4.4 m, 1.2 m apart";
  EXPECT_EQ(classes[kMovers].begins.size(), 1U) << "the cyclist comes after the drive";
  EXPECT_EQ(classes[kWay].begins.size(), 1U);
  // Ten units a metre, y down: from one pole to the next, and from the wall down to the pole's lower edge.
  const auto& poles = classes[kPoles].begins;
  EXPECT_NEAR((poles[1] - poles[0] - Eigen::Vector2d(200, 0)).norm(), 0, 1.5);
  const Eigen::Vector2d wall_to_pole = poles[0] - classes[kWalls].begins[0];
  EXPECT_NEAR(wall_to_pole.x(), 10 * (20 - 0.25 - 10), 1.5);
  EXPECT_NEAR(wall_to_pole.y(), 10 * (12 - 6 + 0.25), 1.5);
}

TEST(Picture, every_shipped_scene_has_one_beside_it_of_the_same_world) {
  for (const ShippedScene& shipped : shipped_scenes()) {
    const std::string name(shipped.name), drawn = picture_of(load_scene(name).value()).value();
    const std::string kept = bytes_of(std::string(ROADVEC_SOURCE "/tools/simulate/scenes/") + name + ".svg");
    const std::string remedy =
        "draw it again: roadvec-simulate " + name + " --picture tools/simulate/scenes/" + name + ".svg";
    // As far as the world reaches, and all that is in it; places may differ by rounding.
    EXPECT_EQ(kept.substr(0, kept.find('\n')), drawn.substr(0, drawn.find('\n'))) << remedy;
    auto kept_classes = classes_of(kept);
    for (const auto& [colour, now] : classes_of(drawn)) {
      const auto& then = kept_classes[colour].begins;
      ASSERT_EQ(then.size(), now.begins.size()) << colour << ", " << remedy;
      for (std::size_t i = 0; i < then.size(); ++i) EXPECT_LT((then[i] - now.begins[i]).norm(), 3) << remedy;
    }
    EXPECT_LT(kept.size(), 40'000U) << name;
  }
}

}  // namespace
}  // namespace roadvec
