#include "drivers/velodyne/decode.h"

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "tests/drivers/velodyne/packets.h"

namespace roadvec {
namespace {

struct Decoded {
  explicit Decoded(LidarModel model, const PacketBytes& bytes, const Calibration& calibration,
                   const DecodeOptions& options = {})
      : decoder(model, calibration, options, counters), accepted(decoder.decode(bytes, packet)) {}
  Decoded(LidarModel model, const PacketBytes& bytes) : Decoded(model, bytes, calibration_of(model)) {}
  [[nodiscard]] LidarCounts counts() const { return snapshot(counters); }
  [[nodiscard]] std::vector<Return> returns() const {
    return {packet.returns.begin(), packet.returns.begin() + packet.return_count};
  }

  LidarCounters counters;
  DecodedPacket packet;
  PacketDecoder decoder;
  bool accepted;
};

/// A packet with a single echo, of a head that stands at `azimuth_cdeg`.
PacketBytes one_echo(LidarModel model, int azimuth_cdeg, int block, int lane, unsigned distance,
                     unsigned intensity = 100) {
  FakeHead head(model, 0);
  head.azimuth_cdeg = azimuth_cdeg;
  PacketBytes bytes = head.next().bytes;
  for (int b = 0; b < kBlocksPerPacket; ++b) {
    for (int j = 0; j < kLanesPerBlock; ++j) put_echo(bytes, b, j, 0, 7);
  }
  put_echo(bytes, block, lane, distance, intensity);
  return bytes;
}

TEST(PacketDecoder, sees_an_echo_ahead_at_azimuth_0_and_to_the_right_at_90_degrees) {
  const Decoded ahead(LidarModel::hdl32e, one_echo(LidarModel::hdl32e, 0, 0, 15, 5000));  // laser 15 is level
  ASSERT_EQ(ahead.packet.return_count, 1U);
  EXPECT_NEAR(ahead.packet.returns[0].x_m, 10.0, 1e-5);
  EXPECT_NEAR(ahead.packet.returns[0].y_m, 0.0, 1e-5);
  EXPECT_NEAR(ahead.packet.returns[0].z_m, 0.0, 1e-5);
  const Decoded right(LidarModel::hdl32e, one_echo(LidarModel::hdl32e, 9000, 0, 15, 5000));
  EXPECT_NEAR(right.packet.returns[0].x_m, 0.0, 1e-5);
  EXPECT_NEAR(right.packet.returns[0].y_m, -10.0, 1e-5);
  EXPECT_NEAR(right.packet.returns[0].azimuth_rad, kPi / 2, 1e-6);
}

TEST(PacketDecoder, takes_distance_0_for_no_echo) {
  const Decoded none(LidarModel::hdl32e, one_echo(LidarModel::hdl32e, 0, 0, 15, 0));
  EXPECT_TRUE(none.accepted);
  EXPECT_EQ(none.packet.return_count, 0U);
}

TEST(PacketDecoder, numbers_the_lower_bank_of_an_hdl64e_from_32) {
  const Decoded lower(LidarModel::hdl64e_s2, one_echo(LidarModel::hdl64e_s2, 0, 3, 5, 5000));
  ASSERT_EQ(lower.packet.return_count, 1U);
  EXPECT_EQ(lower.packet.returns[0].laser, 37);
  EXPECT_EQ(lower.packet.returns[0].time_ns, 48'000U + 7'260U);
}

TEST(PacketDecoder, gives_returns_in_the_order_of_their_times) {
  for (const LidarModel model : kAllModels) {
    for (const bool dual : {false, true}) {
      if (dual && facts_of(model).dual == DualLayout::none) continue;
      FakeHead head(model);
      head.dual = dual;
      const Decoded decoded(model, head.next().bytes);
      const std::vector<Return> returns = decoded.returns();
      // Both echoes of a firing are the same here and come out as one.
      const std::size_t echo_count = !dual ? 384U : model == LidarModel::vls128 ? 128U : 192U;
      EXPECT_EQ(returns.size(), echo_count) << name_of(model);
      EXPECT_TRUE(std::ranges::is_sorted(returns, {}, &Return::time_ns)) << name_of(model);
      EXPECT_EQ(decoded.packet.dual_return, dual) << name_of(model);
      std::set<int> lasers;
      for (const Return& r : returns) lasers.insert(r.laser);
      EXPECT_EQ(lasers.size(), static_cast<std::size_t>(facts_of(model).laser_count));
    }
  }
}

TEST(PacketDecoder, lets_each_laser_follow_the_head_unless_told_not_to) {
  FakeHead head(LidarModel::hdl32e, 20);
  head.azimuth_cdeg = 4500;
  const PacketBytes bytes = head.next().bytes;
  const double last_laser_cdeg = 20.0 * 31 * 1.152 / 46.08;
  const Decoded followed(LidarModel::hdl32e, bytes);
  EXPECT_NEAR(followed.packet.returns[31].azimuth_rad, rad_from_deg((4500 + last_laser_cdeg) / 100), 1e-6);
  EXPECT_NEAR(std::atan2(-followed.packet.returns[31].y_m, followed.packet.returns[31].x_m),
              rad_from_deg((4500 + last_laser_cdeg) / 100), 1e-6);
  const Decoded stiff(LidarModel::hdl32e, bytes, calibration_of(LidarModel::hdl32e), {.maybe_follow_turn = false});
  EXPECT_NEAR(stiff.packet.returns[31].azimuth_rad, rad_from_deg(45), 1e-6);
}

TEST(PacketDecoder, crosses_north_between_two_blocks_without_losing_a_point) {
  for (int first_cdeg = 35'980; first_cdeg < 36'000; ++first_cdeg) {
    FakeHead head(LidarModel::vlp16, 40);
    head.azimuth_cdeg = first_cdeg;
    const Decoded decoded(LidarModel::vlp16, head.next().bytes);
    ASSERT_EQ(decoded.packet.return_count, 384U);
    for (const Return& r : decoded.returns()) {
      EXPECT_GE(r.azimuth_rad, 0.0F);
      EXPECT_LT(r.azimuth_rad, static_cast<float>(kTwoPi));
      EXPECT_GT(r.x_m, 4.7F) << "still ahead";
    }
  }
}

TEST(PacketDecoder, drops_a_group_whose_azimuth_is_no_angle_and_keeps_the_others) {
  for (const unsigned azimuth_cdeg : {36'000U, 36'001U, 50'000U, 65'535U}) {
    for (const int block : {0, 5, 11}) {
      FakeHead head(LidarModel::hdl32e, 20);
      PacketBytes bytes = head.next().bytes;
      put_azimuth_cdeg(bytes, block, azimuth_cdeg);
      const Decoded decoded(LidarModel::hdl32e, bytes);
      EXPECT_TRUE(decoded.accepted);
      EXPECT_EQ(decoded.packet.return_count, 352U);
      EXPECT_EQ(decoded.counts().wrong_azimuth, 1U);
      EXPECT_NEAR(decoded.packet.returns[40].azimuth_rad,
                  rad_from_deg((block <= 1 ? 0.40 : 0.20) + 0.2 * 8 * 1.152 / 46.08), 3e-3);
    }
  }
}

TEST(PacketDecoder, refuses_blocks_that_are_not_laid_out_as_the_model) {
  FakeHead hdl64(LidarModel::hdl64e_s2), hdl32(LidarModel::hdl32e);
  EXPECT_EQ(Decoded(LidarModel::hdl32e, hdl64.next().bytes).counts().wrong_flags, 1U);
  EXPECT_EQ(Decoded(LidarModel::hdl64e_s2, hdl32.next().bytes).counts().wrong_flags, 1U);
  for (const unsigned flag : {0x0000U, 0xFFFFU, 0xEEFEU}) {
    PacketBytes bytes = hdl32.next().bytes;
    put_flag(bytes, 7, flag);
    const Decoded decoded(LidarModel::hdl32e, bytes);
    EXPECT_FALSE(decoded.accepted);
    EXPECT_EQ(decoded.counts().wrong_flags, 1U);
  }
}

TEST(PacketDecoder, only_warns_when_a_vlp16_says_it_is_an_hdl32e) {
  FakeHead head(LidarModel::vlp16);
  PacketBytes bytes = head.next().bytes;
  bytes[kProductIdOffset] = 0x21;
  const Decoded decoded(LidarModel::vlp16, bytes);
  EXPECT_TRUE(decoded.accepted);
  EXPECT_EQ(decoded.packet.return_count, 384U);
  EXPECT_EQ(decoded.decoder.other_product_id_count(), 1U);
}

TEST(PacketDecoder, does_not_take_a_standing_head_for_dual_return) {
  FakeHead head(LidarModel::hdl32e, 0);
  const Decoded decoded(LidarModel::hdl32e, head.next().bytes);
  EXPECT_FALSE(decoded.packet.dual_return);
  EXPECT_EQ(decoded.packet.group_count, 12);
}

TEST(PacketDecoder, does_not_believe_a_dual_byte_of_old_firmware_when_the_azimuths_differ) {
  FakeHead head(LidarModel::hdl32e, 20);
  PacketBytes bytes = head.next().bytes;
  bytes[kReturnModeOffset] = kDualReturnMode;
  EXPECT_FALSE(Decoded(LidarModel::hdl32e, bytes).packet.dual_return);
}

TEST(PacketDecoder, joins_equal_echoes_of_a_dual_packet_and_names_the_others) {
  FakeHead head(LidarModel::vlp16, 20);
  head.dual = true;
  PacketBytes bytes = head.next().bytes;
  put_echo(bytes, 0, 4, 6000, 10);  // last
  put_echo(bytes, 1, 4, 5000, 90);  // strongest
  put_echo(bytes, 0, 9, 0, 0);
  const Decoded decoded(LidarModel::vlp16, bytes);
  ASSERT_TRUE(decoded.packet.dual_return);
  EXPECT_EQ(decoded.packet.group_count, 6);
  ASSERT_EQ(decoded.packet.return_count, 6U * 32 + 1);
  EXPECT_EQ(decoded.packet.returns[3].kind, ReturnKind::both);
  EXPECT_EQ(decoded.packet.returns[4].kind, ReturnKind::last);
  EXPECT_EQ(decoded.packet.returns[4].intensity, 10);
  EXPECT_EQ(decoded.packet.returns[5].kind, ReturnKind::strongest);
  EXPECT_EQ(decoded.packet.returns[5].laser, 4);
  EXPECT_EQ(decoded.packet.returns[10].kind, ReturnKind::strongest) << "no last return";
}

TEST(PacketDecoder, takes_an_hdl64e_s3_that_stands_for_what_it_was_when_it_turned) {
  for (const bool dual : {false, true}) {
    FakeHead turning(LidarModel::hdl64e_s3), standing(LidarModel::hdl64e_s3, 0);
    turning.dual = standing.dual = dual;
    Decoded decoded(LidarModel::hdl64e_s3, standing.next().bytes);
    EXPECT_FALSE(decoded.packet.dual_return) << "it never turned";
    EXPECT_TRUE(decoded.decoder.decode(turning.next().bytes, decoded.packet));
    EXPECT_EQ(decoded.packet.dual_return, dual);
    EXPECT_TRUE(decoded.decoder.decode(standing.next().bytes, decoded.packet));
    EXPECT_EQ(decoded.packet.dual_return, dual);
  }
}

TEST(PacketDecoder, finds_the_strongest_return_of_an_hdl64e_s3_before_the_last) {
  FakeHead head(LidarModel::hdl64e_s3);
  head.dual = true;
  PacketBytes bytes = head.next().bytes;
  put_echo(bytes, 5, 7, 5000, 90);  // second group, lower bank, strongest
  put_echo(bytes, 7, 7, 6000, 10);  // last
  const Decoded decoded(LidarModel::hdl64e_s3, bytes);
  ASSERT_EQ(decoded.packet.return_count, 3U * 64 + 1);
  std::vector<Return> returns = decoded.returns();
  std::erase_if(returns, [](const Return& r) { return r.kind == ReturnKind::both; });
  ASSERT_EQ(returns.size(), 2U);
  EXPECT_EQ(returns[0].kind, ReturnKind::strongest);
  EXPECT_EQ(returns[0].intensity, 90);
  EXPECT_EQ(returns[1].kind, ReturnKind::last);
  for (const Return& r : returns) {
    EXPECT_EQ(r.laser, 39);
    EXPECT_EQ(r.time_ns, 57'600U + lane_time_ns(LidarModel::hdl64e_s3, 1, 7));
  }
}

TEST(PacketDecoder, finds_both_returns_of_a_vls128_and_skips_the_empty_blocks) {
  for (const unsigned flag : {0x0000U, 0xFFFFU}) {
    FakeHead head(LidarModel::vls128);
    head.dual = true;
    PacketBytes bytes = head.next().bytes;
    for (int block = 8; block < kBlocksPerPacket; ++block) {
      put_flag(bytes, block, flag);
      put_azimuth_cdeg(bytes, block, 0xFFFF);
      for (int lane = 0; lane < kLanesPerBlock; ++lane) put_echo(bytes, block, lane, 9999, 99);
    }
    put_echo(bytes, 4, 3, 6000, 10);  // third bank, last
    put_echo(bytes, 5, 3, 5000, 90);  // strongest
    const Decoded decoded(LidarModel::vls128, bytes);
    ASSERT_TRUE(decoded.accepted);
    ASSERT_EQ(decoded.packet.return_count, 129U);
    EXPECT_EQ(decoded.counts().wrong_azimuth, 0U);
    std::vector<Return> returns = decoded.returns();
    std::erase_if(returns, [](const Return& r) { return r.kind == ReturnKind::both; });
    ASSERT_EQ(returns.size(), 2U);
    EXPECT_EQ(returns[0].kind, ReturnKind::last);
    EXPECT_EQ(returns[0].intensity, 10);
    EXPECT_EQ(returns[1].kind, ReturnKind::strongest);
    EXPECT_EQ(returns[1].laser, 67);
    put_flag(bytes, 9, 0xEEFF);
    EXPECT_EQ(Decoded(LidarModel::vls128, bytes).counts().wrong_flags, 1U);
  }
}

TEST(PacketDecoder, refuses_the_modes_of_a_vls128_that_it_cannot_read_and_counts_them_by_name) {
  for (const std::uint8_t mode : {kTripleReturnMode, kConfidenceReturnMode}) {
    FakeHead head(LidarModel::vls128);
    PacketBytes bytes = head.next().bytes;
    bytes[kReturnModeOffset] = mode;
    const Decoded decoded(LidarModel::vls128, bytes);
    EXPECT_FALSE(decoded.accepted);
    EXPECT_EQ(decoded.counts().unread_mode, 1U);
    EXPECT_EQ(decoded.counts().wrong_flags, 0U);
  }
}

TEST(PacketDecoder, knows_the_turn_of_a_vls128_in_dual_mode_from_the_packet_before_even_after_a_loss) {
  for (const int lost_count : {0, 5}) {
    FakeHead head(LidarModel::vls128, 20);
    head.dual = true;
    head.azimuth_cdeg = 35'970;
    Decoded decoded(LidarModel::vls128, head.next().bytes);
    for (int i = 0; i < lost_count; ++i) (void)head.next();
    ASSERT_TRUE(decoded.decoder.decode(head.next().bytes, decoded.packet));
    const Return& last = decoded.packet.returns[127];
    const double share = lane_time_ns(LidarModel::vls128, 3, 31) / 55'296.0;
    const double head_deg = (35'970 + 20 * (lost_count + 1) + 20 * share) / 100;
    const double rotation_deg = deg_from_rad(calibration_of(LidarModel::vls128).lasers[127].rotation_rad);
    EXPECT_NEAR(std::remainder(last.azimuth_rad - rad_from_deg(head_deg - rotation_deg), kTwoPi), 0, 1e-4);
  }
}

TEST(PacketDecoder, gives_the_sector_that_a_head_leaves_out_its_time) {
  FakeHead head(LidarModel::vlp32c, 20);
  PacketBytes bytes = head.next().bytes;
  for (int block = 8; block < kBlocksPerPacket; ++block)
    put_azimuth_cdeg(bytes, block, static_cast<unsigned>(18'140 + 20 * block));
  Decoded decoded(LidarModel::vlp32c, bytes);
  EXPECT_EQ(decoded.packet.groups[7].start_ns, 7U * 55'296);
  EXPECT_NEAR(decoded.packet.groups[8].start_ns, (18'160.0 / 20 + 7) * 55'296, 1);
  EXPECT_NEAR(decoded.decoder.duration_ns(decoded.packet), (18'160.0 / 20 + 11) * 55'296, 1);
  EXPECT_EQ(decoded.packet.returns[8 * 32].time_ns, decoded.packet.groups[8].start_ns);
  // A damaged reading leaps there and back.
  bytes = FakeHead(LidarModel::vlp32c, 20).next().bytes;
  put_azimuth_cdeg(bytes, 5, 20'000);
  ASSERT_TRUE(decoded.decoder.decode(bytes, decoded.packet));
  EXPECT_EQ(decoded.decoder.duration_ns(decoded.packet), 12U * 55'296);
}

TEST(PacketDecoder, follows_the_offsets_that_are_built_in) {
  // Laser 1 of a VLP-32C stands 4.2 degrees before the head's azimuth.
  const Decoded decoded(LidarModel::vlp32c, one_echo(LidarModel::vlp32c, 1000, 0, 1, 2500));
  ASSERT_EQ(decoded.packet.return_count, 1U);
  EXPECT_NEAR(decoded.packet.returns[0].azimuth_rad, rad_from_deg(10.0 - 4.2), 1e-6);
  EXPECT_NEAR(std::hypot(decoded.packet.returns[0].x_m, decoded.packet.returns[0].y_m, decoded.packet.returns[0].z_m),
              10.0, 1e-4);
}

TEST(PacketDecoder, leaves_out_a_laser_that_the_calibration_disables) {
  Calibration calibration = calibration_of(LidarModel::hdl64e_s2);
  calibration.lasers[40].enabled = false;
  FakeHead head(LidarModel::hdl64e_s2);
  const Decoded decoded(LidarModel::hdl64e_s2, head.next().bytes, calibration);
  EXPECT_EQ(decoded.packet.return_count, 378U);
}

/// The formula of decode.h again, in double and step by step.
struct Expected64 {
  double x_m, y_m, z_m;
};
Expected64 by_the_manual(const LaserCalibration& c, double azimuth_rad, double raw_m) {
  const double a = azimuth_rad - c.rotation_rad, flat = std::cos(c.elevation_rad);
  const double far = raw_m + c.distance_m;
  double dx = c.distance_m, dy = c.distance_m;
  if (raw_m < 25.04 && c.distance_x_m != 0 && c.distance_y_m != 0) {
    dx = c.distance_x_m + (c.distance_m - c.distance_x_m) * (std::abs(far * flat * std::sin(a)) - 2.4) / (25.04 - 2.4);
    dy =
        c.distance_y_m + (c.distance_m - c.distance_y_m) * (std::abs(far * flat * std::cos(a)) - 1.93) / (25.04 - 1.93);
  }
  const double right = (raw_m + dx) * flat * std::sin(a) - c.horizontal_offset_m * std::cos(a);
  const double ahead = (raw_m + dy) * flat * std::cos(a) + c.horizontal_offset_m * std::sin(a);
  return {ahead, -right, (raw_m + (dx + dy) / 2) * std::sin(c.elevation_rad) + c.vertical_offset_m};
}

/// Every correction differs from the others and from none.
LaserCalibration odd_laser(double rotation_rad, double elevation_rad) {
  return {.rotation_rad = rotation_rad,
          .elevation_rad = elevation_rad,
          .distance_m = 1.30,
          .distance_x_m = 1.35,
          .distance_y_m = 1.27,
          .vertical_offset_m = 0.21,
          .horizontal_offset_m = 0.026};
}

TEST(PacketDecoder, corrects_an_hdl64e_by_the_two_point_formula_near_and_far) {
  Calibration calibration = calibration_of(LidarModel::hdl64e_s2);
  const LaserCalibration odd = odd_laser(-0.08, -0.3);
  calibration.lasers[0] = odd;
  for (const int azimuth_cdeg : {0, 1234, 9000, 17'999, 27'000, 35'999}) {
    for (const unsigned distance : {300U, 1000U, 5000U, 12'519U, 12'521U, 60'000U}) {
      const Decoded decoded(LidarModel::hdl64e_s2, one_echo(LidarModel::hdl64e_s2, azimuth_cdeg, 0, 0, distance),
                            calibration);
      ASSERT_EQ(decoded.packet.return_count, 1U);
      const Expected64 expected = by_the_manual(odd, rad_from_deg(azimuth_cdeg / 100.0), distance * 0.002);
      EXPECT_NEAR(decoded.packet.returns[0].x_m, expected.x_m, 5e-5) << azimuth_cdeg << " " << distance;
      EXPECT_NEAR(decoded.packet.returns[0].y_m, expected.y_m, 5e-5) << azimuth_cdeg << " " << distance;
      EXPECT_NEAR(decoded.packet.returns[0].z_m, expected.z_m, 5e-5) << azimuth_cdeg << " " << distance;
    }
  }
}

/// [ros-drivers/velodyne] step by step: near corrections at every distance, the vertical offset turned with the beam.
Expected64 by_ros(const LaserCalibration& c, double azimuth_rad, double raw_m) {
  const double a = azimuth_rad - c.rotation_rad, flat = std::cos(c.elevation_rad), rise = std::sin(c.elevation_rad);
  const double far = raw_m + c.distance_m;
  const double dx =
      c.distance_x_m + (c.distance_m - c.distance_x_m) * (std::abs(far * flat * std::sin(a)) - 2.4) / (25.04 - 2.4);
  const double dy =
      c.distance_y_m + (c.distance_m - c.distance_y_m) * (std::abs(far * flat * std::cos(a)) - 1.93) / (25.04 - 1.93);
  const double flat_x = (raw_m + dx) * flat - c.vertical_offset_m * rise,
               flat_y = (raw_m + dy) * flat - c.vertical_offset_m * rise;
  return {flat_y * std::cos(a) + c.horizontal_offset_m * std::sin(a),
          -(flat_x * std::sin(a) - c.horizontal_offset_m * std::cos(a)),
          (raw_m + dy) * rise + c.vertical_offset_m * flat};
}

TEST(PacketDecoder, corrects_as_ros_does_when_told_to) {
  Calibration calibration = calibration_of(LidarModel::hdl64e_s3);
  const LaserCalibration odd = odd_laser(0.05, -0.42);
  calibration.lasers[0] = odd;
  for (const int azimuth_cdeg : {0, 1234, 9000, 27'000}) {
    for (const unsigned distance : {1000U, 5000U, 60'000U}) {
      const Decoded decoded(LidarModel::hdl64e_s3, one_echo(LidarModel::hdl64e_s3, azimuth_cdeg, 0, 0, distance),
                            calibration, {.correction = Correction::ros});
      ASSERT_EQ(decoded.packet.return_count, 1U);
      const Return& r = decoded.packet.returns[0];
      const Expected64 ros = by_ros(odd, rad_from_deg(azimuth_cdeg / 100.0), distance * 0.002);
      EXPECT_NEAR(std::hypot(r.x_m - ros.x_m, r.y_m - ros.y_m, r.z_m - ros.z_m), 0, 1e-4);
      const Expected64 manual = by_the_manual(odd, rad_from_deg(azimuth_cdeg / 100.0), distance * 0.002);
      EXPECT_GT(std::hypot(manual.x_m - ros.x_m, manual.y_m - ros.y_m, manual.z_m - ros.z_m), 0.05);
    }
  }
}

TEST(PacketDecoder, corrects_intensity_by_focal_distance_in_metres_and_keeps_it_within_the_lasers_limits) {
  Calibration calibration = calibration_of(LidarModel::hdl64e_s2);
  calibration.lasers[0].focal_distance_m = 12.0;
  calibration.lasers[0].focal_slope = 1.1;
  calibration.lasers[1].min_intensity = 40;
  calibration.lasers[2].max_intensity = 60;
  const auto intensity = [&](int lane, unsigned distance, unsigned raw) {
    return Decoded(LidarModel::hdl64e_s2, one_echo(LidarModel::hdl64e_s2, 0, 0, lane, distance, raw), calibration)
        .packet.returns[0]
        .intensity;
  };
  const auto squared = [](double v) { return 256 * v * v; };
  const double expected = 50 + 1.1 * std::abs(squared(1 - 12.0 / 131.0) - squared(1 - 20'000.0 / 65'535.0));
  EXPECT_EQ(intensity(0, 20'000, 50), std::lround(expected));
  EXPECT_EQ(intensity(0, 65'000, 200), 255);
  EXPECT_EQ(intensity(1, 1000, 5), 40);
  EXPECT_EQ(intensity(2, 1000, 200), 60);
  EXPECT_EQ(intensity(3, 1000, 77), 77);
}

}  // namespace
}  // namespace roadvec
