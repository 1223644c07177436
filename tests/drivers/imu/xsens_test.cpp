#include "drivers/imu/xsens.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include "core/base/angle.h"
#include "drivers/imu/log_reader.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

constexpr double kSame = 1e-12;

Eigen::Matrix3d rotation(double roll_rad, double pitch_rad, double yaw_rad) {
  return (Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

XsensSample with_euler(double roll_deg, double pitch_deg, double yaw_deg,
                       XsensFrame frame = XsensFrame::east_north_up) {
  XsensSample sample;
  sample.euler_deg = {roll_deg, pitch_deg, yaw_deg};
  sample.frame = frame;
  sample.has_euler = true;
  return sample;
}

ImuSample convert(const XsensSample& sample, const Mounting& mounting = {}) {
  const std::optional<ImuSample> imu = SensorToVehicle(mounting).convert(sensor_axes_of(sample));
  EXPECT_TRUE(imu);
  return imu.value_or(ImuSample{});
}

TEST(SensorToVehicle, a_level_sensor_along_the_vehicle_gives_its_angles_as_they_are) {
  const ImuSample imu = convert(with_euler(2, -3, 40));
  EXPECT_TRUE(imu.has_orientation);
  EXPECT_FALSE(imu.has_rate || imu.has_acceleration);
  EXPECT_NEAR(imu.roll_rad, rad_from_deg(2), kSame);
  EXPECT_NEAR(imu.pitch_rad, rad_from_deg(-3), kSame);
  EXPECT_NEAR(imu.heading_rad, rad_from_deg(40), kSame);
}

TEST(SensorToVehicle, a_sensor_that_looks_left_turns_rates_accelerations_and_heading) {
  XsensSample sample = with_euler(0, 0, 120);
  sample.rate_radps = {1, 2, 3};
  sample.acceleration_mps2 = {4, 5, 6};
  sample.has_rate = sample.has_acceleration = true;
  const ImuSample imu = convert(sample, {.yaw_rad = kPi / 2});  // its x axis points to the vehicle's left
  EXPECT_NEAR(imu.rate_x_radps, -2, kSame);
  EXPECT_NEAR(imu.rate_y_radps, 1, kSame);
  EXPECT_NEAR(imu.rate_z_radps, 3, kSame);
  EXPECT_NEAR(imu.acceleration_x_mps2, -5, kSame);
  EXPECT_NEAR(imu.acceleration_y_mps2, 4, kSame);
  EXPECT_NEAR(imu.acceleration_z_mps2, 6, kSame);
  EXPECT_NEAR(imu.heading_rad, rad_from_deg(30), kSame);
}

TEST(SensorToVehicle, a_sensor_mounted_upside_down_gives_a_level_vehicle) {
  const ImuSample imu = convert(with_euler(180, 0, 25), {.roll_rad = kPi});
  EXPECT_NEAR(imu.roll_rad, 0, kSame);
  EXPECT_NEAR(imu.pitch_rad, 0, kSame);
  EXPECT_NEAR(imu.heading_rad, rad_from_deg(25), kSame);
}

TEST(SensorToVehicle, heading_is_from_east_counter_clockwise_in_every_frame) {
  // A sensor whose x axis points north and whose z axis points up, as each frame says it.
  EXPECT_NEAR(convert(with_euler(0, 0, 90, XsensFrame::east_north_up)).heading_rad, kPi / 2, kSame);
  EXPECT_NEAR(convert(with_euler(0, 0, 0, XsensFrame::north_west_up)).heading_rad, kPi / 2, kSame);
  const ImuSample ned = convert(with_euler(180, 0, 0, XsensFrame::north_east_down));
  EXPECT_NEAR(ned.heading_rad, kPi / 2, kSame);
  EXPECT_NEAR(ned.roll_rad, 0, kSame);
  // Ten degrees to the right of north.
  EXPECT_NEAR(convert(with_euler(180, 0, 10, XsensFrame::north_east_down)).heading_rad, rad_from_deg(80), kSame);
  EXPECT_NEAR(convert(with_euler(0, 0, -10, XsensFrame::north_west_up)).heading_rad, rad_from_deg(80), kSame);
}

TEST(SensorToVehicle, any_mounting_is_undone_from_angles_and_from_a_quaternion) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> any(-1.2, 1.2);
  for (int i = 0; i < 200; ++i) {
    const double roll = any(random), pitch = any(random), heading = any(random);
    const Mounting mounting{any(random), any(random), any(random)};
    const Eigen::Matrix3d R_enu_sensor =
        rotation(roll, pitch, heading) * rotation(mounting.roll_rad, mounting.pitch_rad, mounting.yaw_rad);
    const Eigen::Quaterniond q(R_enu_sensor);
    XsensSample sample;
    sample.quaternion = {q.w(), q.x(), q.y(), q.z()};
    sample.has_quaternion = true;
    XsensSample as_angles = with_euler(deg_from_rad(std::atan2(R_enu_sensor(2, 1), R_enu_sensor(2, 2))),
                                       deg_from_rad(-std::asin(R_enu_sensor(2, 0))),
                                       deg_from_rad(std::atan2(R_enu_sensor(1, 0), R_enu_sensor(0, 0))));
    for (const XsensSample& said : {sample, as_angles}) {
      const ImuSample imu = convert(said, mounting);
      EXPECT_NEAR(imu.roll_rad, roll, 1e-9);
      EXPECT_NEAR(imu.pitch_rad, pitch, 1e-9);
      EXPECT_NEAR(imu.heading_rad, heading, 1e-9);
    }
  }
}

TEST(SensorToVehicle, what_is_no_number_or_no_rotation_is_not_handed_on) {
  XsensSample sample = with_euler(0, std::numeric_limits<double>::quiet_NaN(), 0);
  EXPECT_FALSE(SensorToVehicle({}).convert(sensor_axes_of(sample)));
  EXPECT_FALSE(SensorToVehicle({}).convert({}));
  sample.has_quaternion = true;  // all zero, as a device sends before its filter has started
  EXPECT_FALSE(SensorToVehicle({}).convert(sensor_axes_of(sample)));
  sample.rate_radps = {0, std::numeric_limits<double>::infinity(), 0};
  sample.has_rate = true;
  EXPECT_FALSE(SensorToVehicle({}).convert(sensor_axes_of(sample)));
}

TEST(SensorAxes, a_matrix_says_the_same_as_its_angles) {
  const Eigen::Matrix3d R = rotation(0.1, -0.2, 1.3);
  XsensSample sample;
  std::copy_n(R.data(), 9, sample.matrix.begin());
  sample.has_matrix = true;
  sample.frame = XsensFrame::east_north_up;
  const ImuSample imu = convert(sample);
  EXPECT_NEAR(imu.roll_rad, 0.1, kSame);
  EXPECT_NEAR(imu.pitch_rad, -0.2, kSame);
  EXPECT_NEAR(imu.heading_rad, 1.3, kSame);
  sample.matrix[0] += 0.5;
  EXPECT_FALSE(sensor_axes_of(sample).R_enu_sensor) << "no rotation";
}

TEST(SensorAxes, high_rate_readings_stand_in_where_nothing_else_is_sent) {
  XsensSample sample;
  sample.rate_hr_radps = {{1, 2, 3}};
  sample.acceleration_hr_mps2 = {{4, 5, 6}};
  EXPECT_EQ(convert(sample).rate_z_radps, 3);
  EXPECT_EQ(convert(sample).acceleration_x_mps2, 4);
  sample.rate_radps = {7, 8, 9};
  sample.has_rate = true;
  EXPECT_EQ(convert(sample).rate_z_radps, 9);
}

TEST(XsensClock, counts_on_across_the_wrap_and_a_little_back) {
  XsensClock clock;
  EXPECT_EQ(clock.unwrap(0xFFFFFFF0).ns, 4294967280LL * 100000);
  EXPECT_EQ(clock.unwrap(0x10).ns, (4294967280LL + 32) * 100000);
  EXPECT_EQ(clock.unwrap(0x08).ns, (4294967280LL + 24) * 100000);
}

TEST(XsensDecoder, a_sample_has_the_time_of_the_bytes_that_complete_it) {
  // Rate of turn 0, 0, 1 rad/s.
  const std::vector<std::uint8_t> message = {0xFA, 0xFF, 0x36, 0x0F, 0x80, 0x20, 0x0C, 0, 0, 0,
                                             0,    0,    0,    0,    0,    0x3F, 0x80, 0, 0, 0x51};
  XsensDecoder decoder({});
  MotionSample sample;
  ImuBytes first{{100}, true, std::span(message).first(10)};
  EXPECT_FALSE(decoder.next(first, sample));
  ImuBytes second{{200}, true, std::span(message).subspan(10)};
  ASSERT_TRUE(decoder.next(second, sample));
  EXPECT_EQ(sample.time.ns, 200);
  EXPECT_EQ(std::get<ImuSample>(sample.value).rate_z_radps, 1.0);
  EXPECT_FALSE(decoder.next(second, sample));
  ImuBytes untimed{{}, false, message};
  EXPECT_FALSE(decoder.next(untimed, sample));
  EXPECT_EQ(decoder.untimed_count(), 1U);
}

/// An MTData2 message of a time in ticks of 100 us and a turn about z since the one before.
std::vector<std::uint8_t> turn_message(std::uint32_t ticks, double turn_rad) {
  std::vector<std::uint8_t> bytes = {0xFF, 0x36, 7 + 3 + 16, 0x10, 0x60, 4};
  const auto put = [&bytes](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  };
  put(ticks);
  bytes.insert(bytes.end(), {0x80, 0x30, 16});
  for (const double value : {std::cos(turn_rad / 2), 0.0, 0.0, std::sin(turn_rad / 2)})
    put(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  bytes.push_back(static_cast<std::uint8_t>(0x100 - (sum & 0xFF)));
  bytes.insert(bytes.begin(), 0xFA);
  return bytes;
}

TEST(XsensDecoder, turns_between_messages_become_rates) {
  XsensDecoder decoder({});
  std::vector<double> rates_radps;
  for (const auto& [ticks, turn_rad] : {std::pair{1000U, 0.003}, {1100U, 0.003}, {1200U, -0.002}, {9000U, 0.01}}) {
    const auto message = turn_message(ticks, turn_rad);
    ImuBytes bytes{{ticks}, true, message};
    MotionSample sample;
    while (decoder.next(bytes, sample)) rates_radps.push_back(std::get<ImuSample>(sample.value).rate_z_radps);
  }
  ASSERT_EQ(rates_radps.size(), 2U) << "nothing from the first, nor over a pause";
  EXPECT_NEAR(rates_radps[0], 0.3, 1e-5);
  EXPECT_NEAR(rates_radps[1], -0.2, 1e-5);
}

TEST(XsensRecordings, a_raw_recording_takes_its_times_from_the_device) {
  const auto path = recording("imu/xsens_1/output.bin");
  if (!path) return;
  auto reader = open_imu_recording(*path);
  ASSERT_TRUE(reader) << reader.error().message;
  XsensDecoder decoder({});
  std::vector<MotionSample> samples;
  ImuBytes bytes;
  MotionSample sample;
  while ((*reader)->read(bytes, {}) == ImuReadResult::bytes) {
    while (decoder.next(bytes, sample)) samples.push_back(sample);
  }
  EXPECT_EQ((*reader)->counters().byte_count, 14337U);
  ASSERT_EQ(samples.size(), 96U) << "four of the hundred messages hold GNSS alone";
  EXPECT_EQ(samples[0].time.ns, 51703123LL * 100000);
  EXPECT_EQ(samples[1].time - samples[0].time, 10'000'000);
  // The device lies on its side, at rest: gravity shows along -y, and its roll is -99 degrees.
  const ImuSample& imu = std::get<ImuSample>(samples[1].value);
  EXPECT_TRUE(imu.has_rate && imu.has_acceleration && imu.has_orientation);
  EXPECT_NEAR(std::hypot(imu.acceleration_x_mps2, imu.acceleration_y_mps2, imu.acceleration_z_mps2), 9.81, 0.05);
  EXPECT_NEAR(imu.roll_rad, rad_from_deg(-99.46), 1e-3);
}

}  // namespace
}  // namespace roadvec
