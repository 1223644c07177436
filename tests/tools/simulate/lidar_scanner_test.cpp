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
        const Eigen::Vector3d p = Eigen::AngleAxisd(a.theta_rad, Eigen::Vector3d::UnitZ()) * p_vehicle +
                                  Eigen::Vector3d(std::lerp(a.x_m, b.x_m, share) + scene.car.start_m,
                                                  std::lerp(a.y_m, b.y_m, share) + scene.car.lane_m, 0);
        if (p.x() < 1 || p.x() > 199) continue;  // the ends of the world
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

/// A VLS-128 casts 2.3 million beams a second.
double enough_s(const std::string& model, double of_others_s) { return model == "VLS-128" ? 0.15 : of_others_s; }

TEST_P(LidarModels, without_noise_decoded_returns_lie_on_the_worlds_surfaces) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.lidar.model = GetParam();
  scene.errors.range_noise_m = 0;
  SimulateOptions options;
  options.maybe_duration_s = enough_s(GetParam(), 0.8);
  ASSERT_TRUE(simulate(scene, "plain", folder / "a", options));
  const Offsets offsets = offsets_of_decoded_returns(scene, folder / "a");
  EXPECT_GT(offsets.metres.size(), 60'000U);
  EXPECT_GT(offsets.kerb_count, 100U);
  EXPECT_GT(offsets.wall_count, 10'000U);
  // Half a raw step of range, and half a hundredth of a degree seen from 100 m.
  EXPECT_GE(offsets.share_within(0.003), 0.99);
  EXPECT_EQ(offsets.share_within(0.010), 1.0);
}

TEST_P(LidarModels, with_noise_decoded_returns_lie_within_three_sigma_of_the_surfaces) {
  const TemporaryFolder folder;
  Scene scene = plain_scene();
  scene.lidar.model = GetParam();
  SimulateOptions options;
  options.maybe_duration_s = enough_s(GetParam(), 0.3);
  ASSERT_TRUE(simulate(scene, "plain", folder / "a", options));
  const Offsets offsets = offsets_of_decoded_returns(scene, folder / "a");
  EXPECT_GE(offsets.share_within(3 * 0.02 + 0.002), 0.997);
  EXPECT_LT(offsets.share_within(0.002), 0.9) << "there should be noise";
}

INSTANTIATE_TEST_SUITE_P(, LidarModels,
                         testing::Values("HDL-64E S2", "HDL-64E S3", "HDL-32E", "VLP-16", "Puck Hi-Res", "VLP-32C",
                                         "VLS-128"));

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
