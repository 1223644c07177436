#include "tools/simulate/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace roadvec {
namespace {

constexpr const char* kRoad = "[road]\nwaypoints = [[0, 0], [100, 0]]\n";

std::string error_of(const std::string& text) {
  const auto scene = parse_scene(text, "my.toml");
  return scene ? "" : scene.error().message;
}

TEST(SceneFile, a_value_out_of_range_names_file_line_key_and_range) {
  EXPECT_EQ(error_of(std::string(kRoad) + "kerb_height_m = 3.0\n"),
            "my.toml:3: road.kerb_height_m: 3 is outside 0.02 to 0.5");
}

TEST(SceneFile, an_unknown_key_names_file_line_and_key) {
  EXPECT_EQ(error_of(std::string(kRoad) + "\n[car]\nspeed = 8\n"), "my.toml:5: car.speed: is not a key of this table");
}

TEST(SceneFile, an_unknown_key_in_an_array_of_tables_is_found) {
  EXPECT_EQ(error_of(std::string(kRoad) + "[[road.pole]]\nside = \"left\"\nhigh_m = 3\n"),
            "my.toml:5: road.pole.high_m: is not a key of this table");
}

TEST(SceneFile, a_value_of_the_wrong_type_names_file_line_and_key) {
  EXPECT_EQ(error_of(std::string(kRoad) + "width_m = \"wide\"\n"), "my.toml:3: road.width_m: must be a number");
  EXPECT_EQ(error_of(std::string(kRoad) + "closed = 1\n"), "my.toml:3: road.closed: must be true or false");
  EXPECT_EQ(error_of(std::string(kRoad) + "[[road.wall]]\nside = \"up\"\n"),
            "my.toml:4: road.wall.side: must be one of: left, right");
  EXPECT_THAT(error_of("[road]\nwaypoints = [[0, 0], [1]]\n"),
              testing::StartsWith("my.toml:2: road.waypoints: must be"));
  EXPECT_EQ(error_of("car = 3\n[road]\nwaypoints = [[0, 0], [100, 0]]\n"), "my.toml:1: car: must be a table");
}

TEST(SceneFile, numbers_that_are_none_are_refused) {
  EXPECT_EQ(error_of(std::string(kRoad) + "width_m = nan\n"), "my.toml:3: road.width_m: must be a number");
  EXPECT_THAT(error_of("[road]\nwaypoints = [[0, 0], [inf, 0]]\n"), testing::StartsWith("my.toml:2: road.waypoints:"));
}

TEST(SceneFile, mistakes_in_tables_of_the_world_name_their_line) {
  const std::string road = kRoad;
  EXPECT_EQ(error_of(road + "[[road.driveway]]\nwidth_m = 3\n"), "my.toml:3: road.driveway.at_m: is missing");
  EXPECT_EQ(error_of(road + "[[road.verge]]\nmaterial = \"road\"\n"),
            "my.toml:4: road.verge.material: must be one of: grass, gravel");
  EXPECT_EQ(error_of(road + "[[road.fence]]\nlength_m = 3\n"),
            "my.toml:4: road.fence.length_m: is not a key of this table");
  EXPECT_EQ(error_of(road + "[[road.wall]]\nwhen = \"later\"\n"),
            "my.toml:4: road.wall.when: must be one of: always, before, after");
  EXPECT_EQ(error_of(road + "[[island]]\npoints_m = [[0, 0], [1, 0]]\n"),
            "my.toml:4: island.points_m: needs three corners");
  EXPECT_EQ(error_of(road + "[[mover]]\nkind = \"tram\"\n"),
            "my.toml:4: mover.kind: must be one of: car, cyclist, pedestrian");
  EXPECT_EQ(error_of(road + "[[hill]]\nheight_m = 4\n"), "my.toml:3: hill.at_m: is missing");
}

TEST(SceneFile, one_road_may_be_a_table_and_several_are_a_list) {
  EXPECT_EQ(parse_scene(kRoad, "my.toml")->roads.size(), 1U);
  const auto two =
      parse_scene("[[road]]\nwaypoints = [[0, 0], [9, 0]]\n[[road]]\nwaypoints = [[0, 5], [9, 5]]\n", "my.toml");
  ASSERT_TRUE(two);
  EXPECT_EQ(two->roads.size(), 2U);
}

TEST(SceneFile, text_that_is_no_toml_names_file_and_line) {
  EXPECT_THAT(error_of("[road]\nwaypoints = [[0, 0]\n[car]\n"), testing::StartsWith("my.toml:"));
  EXPECT_THAT(error_of("[road]\nwidth_m = 8\nwidth_m = 9\n"), testing::StartsWith("my.toml:3:"));
}

TEST(SceneFile, a_road_without_waypoints_is_refused) {
  EXPECT_THAT(error_of("[car]\nspeed_mps = 8\n"), testing::HasSubstr("road: is missing"));
  EXPECT_EQ(error_of("[road]\nwidth_m = 8\n"), "my.toml:1: road.waypoints: is missing");
}

TEST(SceneFile, a_name_that_is_neither_scene_nor_file_is_told_where_to_look) {
  const auto scene = load_scene("no-such-street");
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().message, testing::HasSubstr("--list"));
}

}  // namespace
}  // namespace roadvec
