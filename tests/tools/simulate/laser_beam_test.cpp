#include "tools/simulate/laser_beam.h"

#include <gtest/gtest.h>

#include "core/base/angle.h"
#include "drivers/velodyne/decode.h"
#include "tools/simulate/lidar_head.h"
#include "tools/simulate/scene_file.h"

namespace roadvec {
namespace {

/// Packs one echo of one laser of an HDL-64E, and decodes it as the daemon does.
class OneEcho {
 public:
  explicit OneEcho(const LidarHead& head) : decoder_(head.model, head.calibration, {}, counters_) {}

  Return decode(int laser, int azimuth_cdeg, unsigned raw, unsigned intensity) {
    PacketBytes bytes{};
    for (int block = 0; block < kBlocksPerPacket; ++block) {
      std::uint8_t* at = bytes.data() + static_cast<std::size_t>(block) * kBlockBytes;
      put(at, kBankFlags[static_cast<std::size_t>(block % 2)]);
      put(at + kBlockAzimuthOffset, static_cast<unsigned>(azimuth_cdeg + block / 2) % kFullCircle_cdeg);
    }
    const auto lane = static_cast<std::size_t>(laser % kLanesPerBlock);
    std::uint8_t* echo = bytes.data() + static_cast<std::size_t>(laser / kLanesPerBlock) * kBlockBytes +
                         kBlockEchoesOffset + lane * kEchoBytes;
    put(echo, raw);
    echo[2] = static_cast<std::uint8_t>(intensity);
    EXPECT_TRUE(decoder_.decode(bytes, packet_));
    EXPECT_EQ(packet_.return_count, 1U);
    return packet_.returns[0];
  }

 private:
  static void put(std::uint8_t* at, unsigned value) {
    at[0] = static_cast<std::uint8_t>(value & 0xFF);
    at[1] = static_cast<std::uint8_t>(value >> 8);
  }
  LidarCounters counters_;
  PacketDecoder decoder_;
  DecodedPacket packet_;
};

TEST(LaserBeam, what_is_packed_for_a_place_on_the_beam_decodes_to_that_place_near_and_far) {
  const LidarHead head = make_lidar_head("HDL-64E S2").value();
  OneEcho echo(head);
  for (int laser = 0; laser < 64; laser += 3) {
    const LaserOptics optics(head.calibration.lasers[static_cast<std::size_t>(laser)]);
    ASSERT_TRUE(optics.has_near());
    for (int azimuth_cdeg = 0; azimuth_cdeg < kFullCircle_cdeg; azimuth_cdeg += 2311) {
      const HeadAzimuth azimuth(rad_from_deg(azimuth_cdeg / 100.0));
      for (const double wanted_m : {2.0, 5.0, 12.0, 24.0, 30.0, 90.0}) {
        LaserBeam beam = wanted_m < 25 ? optics.near_beam(azimuth) : optics.far_beam(azimuth);
        const auto raw = static_cast<unsigned>(std::lround(beam.raw_m(wanted_m) / 0.002));
        const Return r = echo.decode(laser, azimuth_cdeg, raw, 100);
        const Eigen::Vector3d place_m = beam.origin_m + wanted_m * beam.direction;
        EXPECT_LT((place_m -
                   Eigen::Vector3d(static_cast<double>(r.x_m), static_cast<double>(r.y_m), static_cast<double>(r.z_m)))
                      .norm(),
                  0.001 + 1e-4)
            << "laser " << laser << ", " << azimuth_cdeg << ", " << wanted_m << " m";
      }
    }
  }
}

TEST(LaserBeam, an_s3_corrects_intensity_back_to_what_the_surface_gave) {
  const LidarHead head = make_lidar_head("HDL-64E S3").value();
  OneEcho echo(head);
  const LaserOptics optics(head.calibration.lasers[7]);
  for (const double raw_steps : {2000.0, 5000.0, 12000.0}) {
    const double raw_intensity = optics.raw_intensity(200, raw_steps);
    EXPECT_LT(raw_intensity, 200);
    const Return r = echo.decode(7, 100, static_cast<unsigned>(raw_steps),
                                 static_cast<unsigned>(std::lround(std::max(0.0, raw_intensity))));
    EXPECT_NEAR(r.intensity, 200, 1.5);
  }
}

TEST(LidarHead, made_up_lasers_are_spread_as_those_of_real_heads) {
  // Mean and spread of the steps between neighbours in elevation, and of the corrections: an S2.1's and an S3's tables.
  const LidarHead head = make_lidar_head("HDL-64E S2").value();
  for (const std::size_t bank : {0U, 1U}) {
    std::vector<double> elevations_deg;
    double most_rotation_deg = 0;
    for (std::size_t i = 32 * bank; i < 32 * bank + 32; ++i) {
      const LaserCalibration& laser = head.calibration.lasers[i];
      elevations_deg.push_back(deg_from_rad(laser.elevation_rad));
      most_rotation_deg = std::max(most_rotation_deg, std::abs(deg_from_rad(laser.rotation_rad)));
      EXPECT_NEAR(laser.distance_x_m - laser.distance_m, 0.03, 0.06);
      EXPECT_NE(laser.distance_x_m, laser.distance_y_m);
    }
    std::sort(elevations_deg.begin(), elevations_deg.end());
    double least_deg = 1, most_deg = 0;
    for (std::size_t i = 1; i < elevations_deg.size(); ++i) {
      least_deg = std::min(least_deg, elevations_deg[i] - elevations_deg[i - 1]);
      most_deg = std::max(most_deg, elevations_deg[i] - elevations_deg[i - 1]);
    }
    EXPECT_GT(least_deg, 0.1) << "two lasers at one place";
    EXPECT_GT(most_deg - least_deg, 0.1) << "equal angles";
    EXPECT_LT(most_deg, bank == 0 ? 0.5 : 0.85);
    EXPECT_NEAR(most_rotation_deg, bank == 0 ? 5.7 : 8.6, 0.4);
  }
}

}  // namespace
}  // namespace roadvec
