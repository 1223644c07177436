#include "tools/simulate/simulate.h"

#include <GeographicLib/LocalCartesian.hpp>
#include <nlohmann/json.hpp>

#include "tests/tools/simulate/made_drive.h"
#include "tools/simulate/city.h"

namespace roadvec {
namespace {

const char* const kFiles[] = {"drive.toml",  "lidar.pcap", "db.xml",          "can.log",
                              "vehicle.dbc", "imu.log",    "truth/poses.tum", "truth/boundaries.geojson"};

void make(const Scene& scene, const std::filesystem::path& out, std::uint64_t seed, double duration_s = 0.15) {
  SimulateOptions options;
  options.seed = seed;
  options.maybe_duration_s = duration_s;
  const auto report = simulate(scene, "plain", out, options);
  ASSERT_TRUE(report) << report.error().message;
}

TEST(Simulate, same_seed_gives_the_same_bytes_in_every_file) {
  const TemporaryFolder folder;
  make(plain_scene(), folder / "a", 3);
  make(plain_scene(), folder / "b", 3);
  for (const std::string file : kFiles) {
    EXPECT_FALSE(bytes_of(folder / ("a/" + file)).empty()) << file;
    EXPECT_EQ(bytes_of(folder / ("a/" + file)), bytes_of(folder / ("b/" + file))) << file;
  }
}

TEST(Simulate, another_seed_gives_other_noise_but_the_same_truth) {
  const TemporaryFolder folder;
  make(plain_scene(), folder / "a", 3);
  make(plain_scene(), folder / "b", 4);
  EXPECT_NE(bytes_of(folder / "a/lidar.pcap"), bytes_of(folder / "b/lidar.pcap"));
  EXPECT_NE(bytes_of(folder / "a/imu.log"), bytes_of(folder / "b/imu.log"));
  EXPECT_EQ(bytes_of(folder / "a/truth/poses.tum"), bytes_of(folder / "b/truth/poses.tum"));
}

TEST(Simulate, a_folder_with_something_in_it_is_refused_and_left_alone) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "mine");
  std::ofstream(folder / "mine/notes.txt") << "keep";
  const auto report = simulate(plain_scene(), "plain", folder / "mine", {});
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().message.find("name another one or remove it"), std::string::npos) << report.error().message;
  EXPECT_FALSE(std::filesystem::exists(folder / "mine/lidar.pcap"));
}

TEST(Simulate, a_model_that_is_not_known_is_refused_before_anything_is_written) {
  const TemporaryFolder folder;
  SimulateOptions options;
  options.maybe_model = "HDL-65";
  ASSERT_FALSE(simulate(plain_scene(), "plain", folder / "a", options));
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

TEST(Simulate, a_car_on_the_sidewalk_is_refused_with_the_place) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.car.lane_m = -3.5;
  const auto report = simulate(scene, "plain", folder / "a", {});
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().message.find("leaves the road"), std::string::npos) << report.error().message;
}

TEST(Simulate, lost_packets_are_counted_and_missing) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.errors.packet_loss = 0.5;
  SimulateOptions options;
  options.maybe_duration_s = 0.3;
  const auto report = simulate(scene, "plain", folder / "a", options);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_NEAR(static_cast<double>(report->lost_packet_count), 521, 80);
  EXPECT_EQ(std::filesystem::file_size(folder / "a/lidar.pcap"), 24 + report->packet_count * (16 + 42 + 1206));
}

TEST(Simulate, true_kerbs_and_walls_lie_at_their_distance_from_the_lane) {
  const TemporaryFolder folder;
  const Scene scene = plain_scene();
  make(scene, folder / "a", 1);
  const GeographicLib::LocalCartesian map(scene.anchor.latitude_deg, scene.anchor.longitude_deg, scene.anchor.height_m);
  const std::string text = bytes_of(folder / "a/truth/boundaries.geojson");
  int curb_count = 0, barrier_count = 0;
  const nlohmann::json boundaries = nlohmann::json::parse(text);
  for (const nlohmann::json& feature : boundaries.at("features")) {
    const bool curb = feature.at("properties").at("kind") == "curb";
    EXPECT_NEAR(feature.at("properties").at("height_m").get<double>(), curb ? kKerbHeight_m : kWallHeight_m, 1e-9);
    for (const nlohmann::json& position : feature.at("geometry").at("coordinates")) {
      double east_m = 0, north_m = 0, up_m = 0;
      map.Forward(position.at(1).get<double>(), position.at(0).get<double>(), scene.anchor.height_m, east_m, north_m,
                  up_m);
      const double scene_y_m = north_m + scene.car.lane_m, scene_x_m = east_m + scene.car.start_m;
      if (scene_x_m < 0.01 || scene_x_m > kRoad_m - 0.01) continue;  // the ends of the world
      EXPECT_NEAR(std::abs(scene_y_m), curb ? kKerb_m : kWall_m, 0.001);
      ++(curb ? curb_count : barrier_count);
    }
  }
  EXPECT_GT(curb_count, 200);
  EXPECT_GT(barrier_count, 200);
}

TEST(Simulate, the_truth_is_the_world_at_the_drives_end_and_says_what_went_and_what_came) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.maybe_change_s = 0.1;
  scene.roads.front().walls[0].row.when = When::before;
  scene.roads.front().walls[1].row.when = When::after;
  make(scene, folder / "a", 1, 0.25);
  double removed = 0, came = 0, kerb = 0;
  const nlohmann::json boundaries = nlohmann::json::parse(bytes_of(folder / "a/truth/boundaries.geojson"));
  for (const nlohmann::json& feature : boundaries.at("features")) {
    const nlohmann::json& properties = feature.at("properties");
    const auto pieces = static_cast<double>(feature.at("geometry").at("coordinates").size() - 1);
    if (properties.at("kind") == "curb") {
      kerb += pieces;
      EXPECT_FALSE(properties.contains("from_s") || properties.contains("until_s"));
    } else {
      EXPECT_NE(properties.contains("from_s"), properties.contains("until_s"));
      EXPECT_EQ(properties.contains("until_s"), properties.value("removed", false));
      (properties.contains("until_s") ? removed : came) += pieces;
    }
  }
  // In pieces of half a metre, and splinters at the road's ends.
  EXPECT_EQ(removed, 2 * kRoad_m);
  EXPECT_EQ(came, 2 * kRoad_m);
  EXPECT_NEAR(kerb, 4 * kRoad_m, 8);
}

TEST(Simulate, true_poses_come_a_hundred_times_a_second_and_where_each_revolution_ends) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.lidar.model = "VLP-16";
  scene.lidar.rotation_hz = 8;
  make(scene, folder / "a", 1, 0.6);
  const auto poses = read_tum(folder / "a/truth/poses.tum"), sweeps = read_tum(folder / "a/truth/sweeps.tum");
  ASSERT_EQ(poses.size(), 61U);
  ASSERT_EQ(sweeps.size(), 4U);
  const double start_s = static_cast<double>(scene.start_ns) * 1e-9;
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_NEAR(poses[i].time_s - start_s, 0.01 * static_cast<double>(i), 1e-6);
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    const double after_s = 0.125 * static_cast<double>(i + 1);
    EXPECT_NEAR(sweeps[i].time_s - start_s, after_s, 1e-6);
    const TruePose &before = poses[static_cast<std::size_t>(100 * after_s)],
                   &after = poses[static_cast<std::size_t>(100 * after_s) + 1];
    const double share = (sweeps[i].time_s - before.time_s) / 0.01;
    EXPECT_LT((sweeps[i].T_map_vehicle.translation() - (1 - share) * before.T_map_vehicle.translation() -
               share * after.T_map_vehicle.translation())
                  .norm(),
              2e-4);
  }
}

/// Relative to the folder, in order.
std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path().lexically_relative(folder));
  }
  std::ranges::sort(files);
  return files;
}

std::vector<std::string> all_scenes() {
  std::vector<std::string> names{"city"};
  for (const ShippedScene& shipped : shipped_scenes()) names.emplace_back(shipped.name);
  return names;
}

class ShippedScenes : public testing::TestWithParam<std::string> {};

TEST_P(ShippedScenes, can_be_driven_and_give_the_same_bytes_again) {
  const TemporaryFolder folder;
  for (const char* const run : {"a", "b"}) {
    auto scene = GetParam() == "city" ? parse_scene(city_scene(3, 0.4).value(), "city") : load_scene(GetParam());
    ASSERT_TRUE(scene) << scene.error().message;
    EXPECT_FALSE(scene->description.empty());
    scene->lidar.model = "VLP-16";  // has the fewest lasers
    make(*scene, folder / run, 1, 0.3);
  }
  const auto files = files_in(folder / "a");
  EXPECT_GE(files.size(), 7U);
  EXPECT_EQ(files, files_in(folder / "b"));
  for (const auto& file : files) EXPECT_EQ(bytes_of(folder / "a" / file), bytes_of(folder / "b" / file)) << file;
}

INSTANTIATE_TEST_SUITE_P(, ShippedScenes, testing::ValuesIn(all_scenes()), [](const auto& name) { return name.param; });

}  // namespace
}  // namespace roadvec
