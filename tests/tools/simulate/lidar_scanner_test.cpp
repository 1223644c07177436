#include "tools/simulate/lidar_scanner.h"

#include <algorithm>

#include "drivers/velodyne/decode.h"
#include "drivers/velodyne/pcap_reader.h"
#include "tests/tools/simulate/made_drive.h"

namespace roadvec {
namespace {

/// Distance of a point from the nearest surface of plain_scene(), straight from its few planes.
double off_surface_m(const Eigen::Vector3d& p) {
  const double y = std::abs(p.y());
  const auto beyond = [](double value, double low, double high) { return std::max({low - value, value - high, 0.0}); };
  const double road = std::hypot(p.z(), beyond(y, 0, kKerb_m));
  const double kerb = std::hypot(y - kKerb_m, beyond(p.z(), 0, kKerbHeight_m));
  const double sidewalk = std::hypot(p.z() - kKerbHeight_m, beyond(y, kKerb_m, kWall_m));
  const double wall = std::hypot(y - kWall_m, beyond(p.z(), kKerbHeight_m, kKerbHeight_m + kWallHeight_m));
  return std::min({road, kerb, sidewalk, wall});
}

struct Offsets {
  std::vector<double> metres;
  std::size_t kerb_count = 0, wall_count = 0;
  [[nodiscard]] double share_within(double limit_m) const {
    const auto count = std::count_if(metres.begin(), metres.end(), [&](double m) { return m <= limit_m; });
    return static_cast<double>(count) / static_cast<double>(metres.size());
  }
};

/// Decodes a made drive with the driver and places every return with the true path.
Offsets offsets_of_decoded_returns(const Scene& scene, const std::filesystem::path& drive) {
  Offsets offsets;
  LidarCounters counters;
  const auto model = lidar_model_from(scene.lidar.model);
  const auto calibration = calibration_for(*model, facts_of(*model).needs_calibration() ? drive / "db.xml" : "");
  EXPECT_TRUE(calibration) << calibration.error().message;
  PacketDecoder decoder(*model, *calibration, {}, counters);
  auto reader = PcapReader::open(drive / "lidar.pcap", {}, counters);
  EXPECT_TRUE(reader) << reader.error().message;
  const auto poses = read_tum(drive / "truth/poses.tum");
  const auto mounting = Eigen::AngleAxisd(rad_from_deg(scene.lidar.yaw_deg), Eigen::Vector3d::UnitZ()) *
                        Eigen::AngleAxisd(rad_from_deg(scene.lidar.pitch_deg), Eigen::Vector3d::UnitY()) *
                        Eigen::AngleAxisd(rad_from_deg(scene.lidar.roll_deg), Eigen::Vector3d::UnitX());
  const Eigen::Matrix3d R_vehicle_lidar = mounting.toRotationMatrix();
  DecodedPacket packet;
  std::span<const RawPacket> batch;
  while ((*reader)->read(batch, std::chrono::milliseconds(0)) == ReadResult::packets) {
    for (const RawPacket& raw : batch) {
      EXPECT_TRUE(decoder.decode(raw.bytes, packet));
      const double start_s =
          seconds_between({scene.start_ns}, raw.arrived) - 1e-9 * static_cast<double>(decoder.duration_ns(packet));
      for (std::uint32_t i = 0; i < packet.return_count; ++i) {
        const Return& echo = packet.returns[i];
        const double at =
            std::clamp((start_s + 1e-9 * echo.time_ns) * 100, 0.0, static_cast<double>(poses.size()) - 1.001);
        const TruePose &a = poses[static_cast<std::size_t>(at)], &b = poses[static_cast<std::size_t>(at) + 1];
        const double share = at - std::floor(at);
        const Eigen::Vector3d p_vehicle = R_vehicle_lidar * Eigen::Vector3d(echo.x_m, echo.y_m, echo.z_m) +
                                          Eigen::Vector3d(scene.lidar.x_m, scene.lidar.y_m, scene.lidar.z_m);
        const Eigen::Vector3d p = (1 - share) * (a.T_map_vehicle * p_vehicle) + share * (b.T_map_vehicle * p_vehicle) +
                                  Eigen::Vector3d(scene.car.start_m, scene.car.lane_m, 0);
        if (p.x() < 1 || p.x() > kRoad_m - 1) continue;  // the ends of the world
        offsets.metres.push_back(off_surface_m(p));
        offsets.kerb_count += std::abs(std::abs(p.y()) - kKerb_m) < 0.01 && p.z() > 0.02 && p.z() < 0.10;
        offsets.wall_count += std::abs(p.y()) > kWall_m - 0.1 && p.z() > 0.3;
      }
    }
  }
  EXPECT_EQ(counters.wrong_flags.value(), 0U);
  return offsets;
}

class LidarModels : public testing::TestWithParam<const char*> {};

/// One turn of a head on plain_scene()'s road, or of 16 lasers two.
Scene turn_of(const std::string& model) {
  Scene scene = plain_scene();
  scene.lidar.model = model;
  scene.lidar.rotation_hz = 20;
  return scene;
}
SimulateOptions turn_options(const std::string& model) {
  SimulateOptions options;
  options.maybe_duration_s = facts_of(lidar_model_from(model).value()).laser_count == 16 ? 0.1 : 0.05;
  return options;
}

TEST_P(LidarModels, without_noise_decoded_returns_lie_on_the_worlds_surfaces) {
  const TemporaryFolder folder;
  Scene scene = turn_of(GetParam());
  scene.errors.range_noise_m = 0;
  ASSERT_TRUE(simulate(scene, "plain", folder / "a", turn_options(GetParam())));
  const Offsets offsets = offsets_of_decoded_returns(scene, folder / "a");
  EXPECT_GT(offsets.metres.size(), 15'000U);
  EXPECT_GT(offsets.kerb_count, 30U);
  EXPECT_GT(offsets.wall_count, 5'000U);
  // Half a raw step of range, and half a hundredth of a degree seen from 100 m.
  EXPECT_GE(offsets.share_within(0.003), 0.99);
  EXPECT_GE(offsets.share_within(0.010), 0.999) << "but for mixed returns at edges";
}

TEST_P(LidarModels, with_noise_decoded_returns_lie_within_three_sigma_of_the_surfaces) {
  const TemporaryFolder folder;
  const Scene scene = turn_of(GetParam());
  ASSERT_TRUE(simulate(scene, "plain", folder / "a", turn_options(GetParam())));
  const Offsets offsets = offsets_of_decoded_returns(scene, folder / "a");
  EXPECT_GE(offsets.share_within(3 * 0.02 + 0.002), 0.997);
  EXPECT_LT(offsets.share_within(0.002), 0.9) << "there should be noise";
}

INSTANTIATE_TEST_SUITE_P(, LidarModels,
                         testing::Values("HDL-64E S2", "HDL-64E S3", "HDL-32E", "VLP-16", "Puck Hi-Res", "VLP-32C",
                                         "VLS-128"));

/// The packets of a made drive, as captured.
std::vector<RawPacket> packets_of(const std::filesystem::path& drive) {
  LidarCounters counters;
  auto reader = PcapReader::open(drive / "lidar.pcap", {}, counters);
  EXPECT_TRUE(reader) << reader.error().message;
  std::vector<RawPacket> packets;
  std::span<const RawPacket> batch;
  while ((*reader)->read(batch, std::chrono::milliseconds(0)) == ReadResult::packets) {
    packets.insert(packets.end(), batch.begin(), batch.end());
  }
  return packets;
}

/// Poles before the walls: beams that half miss them come back twice.
Scene with_poles(Scene scene) {
  for (const Side side : {Side::left, Side::right}) {
    PoleSpec pole;
    pole.row.side = side;
    pole.setback_m = 2;
    pole.every_m = 2;
    pole.radius_m = 0.15;
    scene.roads.front().poles.push_back(pole);
  }
  return scene;
}

class DualModels : public testing::TestWithParam<const char*> {};

TEST_P(DualModels, beams_that_half_miss_a_pole_come_back_twice_and_the_last_return_is_the_farther_one) {
  const TemporaryFolder folder;
  Scene scene = with_poles(turn_of(GetParam()));
  scene.lidar.return_mode = ReturnMode::dual;
  scene.errors.range_noise_m = 0;
  ASSERT_TRUE(simulate(scene, "poles", folder / "a", turn_options(GetParam())));
  const LidarHead head = make_lidar_head(GetParam()).value();
  LidarCounters counters;
  PacketDecoder decoder(head.model, head.calibration, {}, counters);
  DecodedPacket packet;
  int both_count = 0, pair_count = 0;
  const auto range_m = [](const Return& r) {
    return std::hypot(static_cast<double>(r.x_m), static_cast<double>(r.y_m), static_cast<double>(r.z_m));
  };
  for (const RawPacket& raw : packets_of(folder / "a")) {
    ASSERT_TRUE(decoder.decode(raw.bytes, packet));
    ASSERT_TRUE(packet.dual_return);
    for (std::uint32_t i = 0; i < packet.return_count; ++i) {
      const Return& r = packet.returns[i];
      both_count += r.kind == ReturnKind::both ? 1 : 0;
      if (r.kind == ReturnKind::both || i + 1 == packet.return_count) continue;
      const Return& other = packet.returns[i + 1];
      if (other.laser != r.laser || other.time_ns != r.time_ns) continue;
      const bool r_is_last = r.kind == ReturnKind::last;
      EXPECT_GT(range_m(r_is_last ? r : other), range_m(r_is_last ? other : r) + 0.9);
      ++pair_count;
    }
  }
  EXPECT_GT(both_count, 5'000);
  EXPECT_GT(pair_count, 20);
  EXPECT_EQ(counters.wrong_flags.value(), 0U);
}

INSTANTIATE_TEST_SUITE_P(, DualModels,
                         testing::Values("HDL-64E S3", "HDL-32E", "VLP-16", "Puck Hi-Res", "VLP-32C", "VLS-128"));

TEST(LidarScanner, last_mode_sees_past_the_edges_of_poles_and_strongest_mode_does_not) {
  const auto near_count = [](ReturnMode mode) {
    const TemporaryFolder folder;
    Scene scene = with_poles(plain_scene());
    scene.lidar.return_mode = mode;
    SimulateOptions options;
    options.maybe_duration_s = 0.1;
    const LidarHead head = make_lidar_head(scene.lidar.model).value();
    EXPECT_TRUE(simulate(scene, "poles", folder / "a", options));
    LidarCounters counters;
    PacketDecoder decoder(head.model, head.calibration, {}, counters);
    DecodedPacket packet;
    int count = 0;
    for (const RawPacket& raw : packets_of(folder / "a")) {
      EXPECT_TRUE(decoder.decode(raw.bytes, packet));
      for (std::uint32_t i = 0; i < packet.return_count; ++i) {
        const Return& r = packet.returns[i];
        count += r.y_m > 7.0F && r.y_m < 8.6F && std::abs(r.x_m) < 12 && r.z_m > -1.2F ? 1 : 0;
      }
    }
    return count;
  };
  EXPECT_LT(near_count(ReturnMode::last), 0.98 * near_count(ReturnMode::strongest));
}

TEST(LidarScanner, two_returns_from_a_head_that_sends_one_are_refused) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.lidar.return_mode = ReturnMode::dual;
  const auto report = simulate(scene, "plain", folder / "a", {});
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().message.find("lidar.return_mode"), std::string::npos) << report.error().message;
}

TEST(LidarScanner, packets_overtake_each_other_as_often_as_asked_and_arrivals_never_go_back) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.errors.packet_reordering = 0.2;
  SimulateOptions options;
  options.maybe_duration_s = 0.2;
  ASSERT_TRUE(simulate(scene, "plain", folder / "a", options));
  const std::vector<RawPacket> packets = packets_of(folder / "a");
  EXPECT_EQ(packets.size(), 695U) << "none is lost";
  int back_count = 0;
  for (std::size_t i = 1; i < packets.size(); ++i) {
    EXPECT_LT(packets[i - 1].arrived, packets[i].arrived);
    back_count += device_time_us(packets[i].bytes) < device_time_us(packets[i - 1].bytes) ? 1 : 0;
  }
  EXPECT_NEAR(back_count, 0.2 / 1.2 * 695, 35);
}

TEST(LidarScanner, flat_ground_fades_with_range_and_more_so_when_it_is_wet) {
  const auto shares = [](double wet) {
    const TemporaryFolder folder;
    Scene scene = plain_scene();
    scene.roads.front().walls.clear();
    scene.lidar.wet = wet;
    SimulateOptions options;
    options.maybe_duration_s = 0.2;
    EXPECT_TRUE(simulate(scene, "plain", folder / "a", options));
    const LidarHead head = make_lidar_head(scene.lidar.model).value();
    LidarCounters counters;
    PacketDecoder decoder(head.model, head.calibration, {}, counters);
    DecodedPacket packet;
    std::array<int, 64> returns{};
    for (const RawPacket& raw : packets_of(folder / "a")) {
      EXPECT_TRUE(decoder.decode(raw.bytes, packet));
      for (std::uint32_t i = 0; i < packet.return_count; ++i) ++returns[packet.returns[i].laser];
    }
    std::vector<std::pair<double, double>> by_elevation;
    for (std::size_t i = 0; i < returns.size(); ++i) {
      by_elevation.emplace_back(deg_from_rad(head.calibration.lasers[i].elevation_rad), returns[i] / 4167.0);
    }
    std::ranges::sort(by_elevation);
    return by_elevation;
  };
  const auto dry = shares(0), wet = shares(1);
  EXPECT_GT(dry.front().second, 0.98);
  double dry_sum = 0, wet_sum = 0;
  for (std::size_t i = 0; i < dry.size(); ++i) {
    dry_sum += dry[i].second;
    wet_sum += wet[i].second;
    EXPECT_LT(dry[i].second, dry[i].first > -0.8 ? 0.05 : 1.01) << dry[i].first;
  }
  EXPECT_LT(wet_sum, 0.8 * dry_sum);
}

TEST(LidarScanner, each_laser_keeps_its_own_range_bias) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.errors.range_noise_m = 0;
  scene.errors.laser_bias_m = 0.05;
  SimulateOptions options;
  options.maybe_duration_s = 0.2;
  ASSERT_TRUE(simulate(scene, "plain", folder / "a", options));
  EXPECT_LT(offsets_of_decoded_returns(scene, folder / "a").share_within(0.003), 0.7);
}

}  // namespace
}  // namespace roadvec
