#include "tools/import/oxts_track.h"

#include <gtest/gtest.h>

#include "core/base/angle.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {
namespace {

/// Ten rows a second from 1000 s on, of a car that speeds up and turns ever faster to the left, across straight back.
std::vector<OxtsSample> rows() {
  std::vector<OxtsSample> samples(11);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double t = 0.1 * static_cast<double>(i);
    samples[i].time = {1'000'000'000'000 + static_cast<std::int64_t>(i) * 100'000'000};
    samples[i].forward_mps = 5 + 2 * t;
    samples[i].rate_radps.z() = 0.1 + 0.1 * t;
    samples[i].yaw_rad = wrap_rad(3.1 + 0.2 * t);
    samples[i].acceleration_mps2.z() = 9.81;
  }
  return samples;
}
SensorTime at_s(double t) { return {1'000'000'000'000 + std::llround(t * 1e9)}; }

TEST(OxtsTrack, attitude_is_of_its_time_and_rates_come_late) {
  const auto samples = rows();
  const OxtsTrack track(samples);
  const OxtsSample sample = track.at(at_s(0.25));
  EXPECT_NEAR(sample.yaw_rad, wrap_rad(3.15), 1e-12);
  const double told_s = 0.25 + 1e-9 * static_cast<double>(kOxtsLag_ns);
  EXPECT_NEAR(sample.forward_mps, 5 + 2 * told_s, 1e-12);
  EXPECT_NEAR(sample.rate_radps.z(), 0.1 + 0.1 * told_s, 1e-12);
}

TEST(OxtsTrack, before_and_after_its_rows_rates_stay_and_the_attitude_goes_on_a_little) {
  const auto samples = rows();
  const OxtsTrack track(samples);
  EXPECT_NEAR(track.at(at_s(-0.04)).yaw_rad, 3.1 - 0.2 * 0.04, 1e-12);
  EXPECT_NEAR(track.at(at_s(-5)).yaw_rad, 3.1 - 0.2 * 0.05, 1e-12);
  EXPECT_NEAR(track.at(at_s(1.04)).yaw_rad, wrap_rad(3.1 + 0.2 * 1.04), 1e-12);
  EXPECT_EQ(track.at(at_s(-5)).forward_mps, 5);
  EXPECT_EQ(track.at(at_s(5)).forward_mps, 7);
}

TEST(OxtsTrack, the_axle_goes_faster_than_a_box_on_the_inner_side) {
  OxtsSample sample;
  sample.forward_mps = 5;
  sample.rate_radps.z() = 0.5;
  const AxleMotion motion = axle_motion(sample, 0.4);
  EXPECT_DOUBLE_EQ(motion.speed_mps, 5.2);
  EXPECT_DOUBLE_EQ(motion.yaw_rate_radps, 0.5);
}

TEST(OxtsTrack, the_can_log_decodes_to_the_motion) {
  auto samples = rows();
  for (OxtsSample& sample : samples) {
    sample.forward_mps = 5;
    sample.rate_radps.z() = 0.3;
  }
  const OxtsTrack track(samples);
  const KittiCar car;
  const TemporaryFolder folder;
  auto file = OutputFile::create(folder / "can.log");
  ASSERT_TRUE(file);
  EXPECT_EQ(write_can_log(track, car, 0, at_s(0), at_s(1), *file), 150U);
  ASSERT_TRUE(file->close());
  const std::string text = bytes_of(folder / "can.log");
  EXPECT_TRUE(text.starts_with("(1000.001300) can0 0C2#"));
  // 15 atan(2.71 * 0.3 / 5) = 138.5 degrees; the left rear wheel 5 - 0.3 * 0.775 m/s = 17.16 km/h.
  EXPECT_EQ(text.substr(23, 8), print("%04X0000", 1385U));
  EXPECT_NE(text.find("1A0#"), std::string::npos);
  const std::size_t wheels = text.find("1A0#") + 4;
  EXPECT_EQ(text.substr(wheels + 8, 4), print("%02X%02X", 1716U & 0xFF, 1716U >> 8));
}

TEST(OxtsTrack, the_imu_log_holds_a_message_every_10_ms) {
  const auto samples = rows();
  const OxtsTrack track(samples);
  const TemporaryFolder folder;
  auto file = OutputFile::create(folder / "imu.log");
  ASSERT_TRUE(file);
  EXPECT_EQ(write_imu_log(track, at_s(0), at_s(0.5), *file), 50U);
  ASSERT_TRUE(file->close());
  EXPECT_TRUE(bytes_of(folder / "imu.log").starts_with("(1000.000000) faff36"));
}

}  // namespace
}  // namespace roadvec
