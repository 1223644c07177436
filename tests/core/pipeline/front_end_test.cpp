#include "core/pipeline/front_end.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/street.h"

namespace roadvec {
namespace {

using test::Street;

/// Drives the test street's middle at a constant speed; wheel speed and gyro may err.
struct Drive {
  explicit Drive(const Street& world) : street(world) {
    keyframe.lvm.reserve(4096, 512);
    keyframe.structure.reserve(4096, 512);
  }
  Street street;
  NoProbe probe;
  FrontEnd front_end{PipelineConfig{},
                     {.vehicle = {.wheelbase_m = 2.7, .track_m = 1.5, .steering_ratio = 15},
                      .lidar = mounting_from({0, 0, Street::kEye_m}, 0, 0, 0),
                      .max_returns_per_sweep = 200'000},
                     probe};
  Keyframe keyframe;
  int sweep_count = 0, keyframe_count = 0;
  double speed_mps = 5, y_m = 0, gyro_bias_radps = 0;

  /// One sweep, taken at its end: the street is the same everywhere along x, so no de-skewing shows.
  bool step(bool slot_is_free = true) {
    const SensorTime start{sweep_count * 100'000'000LL}, end = start + 100'000'000;
    std::vector<MotionSample> motion;
    for (int i = 1; i <= 10; ++i) {
      ImuSample imu{.rate_z_radps = gyro_bias_radps, .has_rate = true};
      motion.push_back({start + i * 10'000'000, WheelSpeed{speed_mps, speed_mps, speed_mps, speed_mps}});
      motion.push_back({start + i * 10'000'000, imu});
    }
    Sweep sweep = street.sweep_from(0, y_m, 0, static_cast<unsigned>(sweep_count), 900);
    sweep.start = start;
    sweep.end = end;
    ++sweep_count;
    const bool taken = front_end.add(sweep, motion, slot_is_free ? &keyframe : nullptr) != nullptr;
    keyframe_count += taken;
    return taken;
  }
};

TEST(FrontEnd, maps_both_kerbs_of_a_street) {
  Drive drive({.noise_m = 0.01});
  for (int i = 0; i < 15; ++i) drive.step();
  double left_m = 0, right_m = 0;
  for (const LineSet::Line& line : drive.keyframe.lvm.lines()) {
    const auto vertices = drive.keyframe.lvm.vertices_of(line);
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      const double y = 0.5 * (vertices[i].y_m + vertices[i - 1].y_m),
                   length = std::abs(vertices[i].x_m - vertices[i - 1].x_m);
      if (std::abs(y - 4) < 0.25) left_m += length;
      if (std::abs(y + 4) < 0.25) right_m += length;
      EXPECT_GT(std::abs(y), 3.7) << "a boundary in the middle of the road";
    }
  }
  EXPECT_GT(left_m, 20);
  EXPECT_GT(right_m, 20);
}

TEST(FrontEnd, takes_a_keyframe_every_two_metres) {
  Drive drive({});
  for (int i = 0; i < 21; ++i) drive.step();
  EXPECT_NEAR(drive.keyframe_count, 6, 1);  // 10.5 m at one per 2 m and the first
  EXPECT_EQ(drive.keyframe.index, static_cast<std::uint64_t>(drive.keyframe_count - 1));
}

TEST(FrontEnd, a_keyframe_waits_while_the_ring_is_full) {
  Drive drive({});
  EXPECT_FALSE(drive.step(false));
  EXPECT_TRUE(drive.step(true));
  EXPECT_EQ(drive.keyframe.index, 0U);
}

TEST(FrontEnd, matching_holds_the_heading_that_a_bad_gyro_would_lose) {
  Drive drive({.noise_m = 0.01});
  drive.gyro_bias_radps = 0.01;  // 0.6 deg/s: 1.7 deg in 3 s without matching
  for (int i = 0; i < 30; ++i) drive.step();
  EXPECT_NEAR(drive.front_end.odometry().pose().theta_rad, 0, rad_from_deg(0.35));
  EXPECT_GT(drive.front_end.report().match_accepted_count, 20U);
}

TEST(FrontEnd, the_same_drive_gives_the_same_keyframes) {
  Drive a({.noise_m = 0.02}), b({.noise_m = 0.02});
  for (int i = 0; i < 12; ++i) {
    ASSERT_EQ(a.step(), b.step());
    ASSERT_EQ(a.keyframe.T_odom_vehicle, b.keyframe.T_odom_vehicle);
    ASSERT_EQ(a.keyframe.lvm, b.keyframe.lvm);
    ASSERT_EQ(a.keyframe.structure, b.keyframe.structure);
  }
}

TEST(FrontEnd, keyframe_lines_stay_within_range) {
  Drive drive({});
  for (int i = 0; i < 8; ++i) drive.step();
  for (const Vertex& v : drive.keyframe.lvm.vertices())
    EXPECT_LE(std::hypot(v.x_m, v.y_m), KeyframeConfig{}.range_m + 1e-9);
  for (const LineSet::Line& line : drive.keyframe.lvm.lines()) EXPECT_GE(line.count, 2U);
}

TEST(FrontEnd, a_straight_line_that_leaves_the_range_is_cut_there_and_not_lost) {
  Drive drive({});  // without noise the simplified kerbs and wall are segments that end beyond the range
  for (int i = 0; i < 12; ++i) drive.step();
  double longest_m = 0;
  for (const LineSet::Line& line : drive.keyframe.structure.lines()) {
    const auto vertices = drive.keyframe.structure.vertices_of(line);
    longest_m = std::max(longest_m, (vertices.back().position() - vertices.front().position()).norm());
  }
  EXPECT_GT(longest_m, 0.8 * 2 * std::sqrt(30.0 * 30.0 - 8.0 * 8.0));  // the wall, 8 m aside, within 30 m
}

TEST(FrontEnd, drives_on_by_motion_alone_while_no_sweep_comes) {
  Drive drive({});
  for (int i = 0; i < 10; ++i) drive.step();
  const double x_m = drive.front_end.odometry().pose().x_m, travelled_m = drive.front_end.report().travelled_m;
  const SensorTime last = drive.front_end.odometry().time();
  std::vector<MotionSample> motion;
  for (int i = 1; i <= 300; ++i) motion.push_back({last + i * 10'000'000LL, WheelSpeed{5, 5, 5, 5}});
  drive.front_end.coast(motion);
  EXPECT_NEAR(drive.front_end.odometry().pose().x_m, x_m + 15, 0.3);
  EXPECT_NEAR(drive.front_end.report().travelled_m, travelled_m + 15, 0.3);
  EXPECT_EQ(drive.front_end.report().sweep_count, 10U);
}

TEST(FrontEnd, survives_sweeps_without_returns_and_without_motion) {
  Drive drive({});
  Sweep empty;
  empty.start = {0};
  empty.end = {100'000'000};
  drive.front_end.add(empty, {}, &drive.keyframe);
  empty.start = {100'000'000};
  empty.end = {100'000'000};  // of no duration
  drive.front_end.add(empty, {}, &drive.keyframe);
  EXPECT_TRUE(drive.keyframe.lvm.empty());
  EXPECT_EQ(drive.front_end.report().sweep_count, 2U);
}

}  // namespace
}  // namespace roadvec
