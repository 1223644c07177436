#include "daemon/health.h"

#include <gmock/gmock.h>

#include "daemon/recent.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;

LidarFacts healthy_lidar() {
  LidarFacts facts;
  facts.age_s = 0.01;
  facts.good_hz = 1800;
  facts.revolutions_hz = 10;
  facts.revolution_count = 100;
  return facts;
}

TEST(Health, of_a_lidar_is_the_worst_that_is_the_matter) {
  EXPECT_EQ(health_of(LidarFacts{}).state, "waiting");
  LidarFacts facts = healthy_lidar();
  EXPECT_EQ(health_of(facts).state, "ok");
  facts.noise_hz = 300;
  EXPECT_EQ(health_of(facts).state, "flooded");
  facts.disordered_hz = 50;
  EXPECT_EQ(health_of(facts).state, "disordered");
  facts.missing_hz = 450;
  EXPECT_EQ(health_of(facts).state, "losing");
  EXPECT_THAT(health_of(facts).detail, HasSubstr("20.0 %"));
  facts.ambiguous = true;
  facts.senders = "10.0.0.1, 10.0.0.2";
  EXPECT_EQ(health_of(facts).state, "ambiguous");
  EXPECT_THAT(health_of(facts).detail, HasSubstr("10.0.0.1, 10.0.0.2"));
  facts.revolutions_hz = 0;
  EXPECT_EQ(health_of(facts).state, "incomplete");
  facts.awaits_calibration = true;
  EXPECT_EQ(health_of(facts).state, "uncalibrated");
  facts.good_hz = 0;
  EXPECT_EQ(health_of(facts).state, "unreadable");
  facts.age_s = 1.5;
  facts.noise_hz = 0;
  EXPECT_EQ(health_of(facts).state, "silent");
  EXPECT_THAT(health_of(facts).detail, HasSubstr("for 1.5 s"));
}

TEST(Health, of_a_lidar_forgives_a_hiccup) {
  LidarFacts facts = healthy_lidar();
  facts.missing_hz = facts.disordered_hz = 10;
  facts.noise_hz = 100;
  EXPECT_TRUE(health_of(facts).ok());
}

TEST(Health, of_a_lidar_that_never_came_tells_silence_from_what_cannot_be_read) {
  EXPECT_THAT(health_of(LidarFacts{}).detail, HasSubstr("no LiDAR packets on the port"));
  LidarFacts facts;
  facts.noise_count = 3;
  facts.senders = "10.0.0.1";
  EXPECT_EQ(health_of(facts).state, "unreadable");
  EXPECT_THAT(health_of(facts).detail, HasSubstr("datagrams come from 10.0.0.1, but none is a data packet"));
}

TEST(Health, of_a_bus_is_what_its_interface_says_and_else_what_comes) {
  EXPECT_EQ(health_of(CanFacts{}).state, "waiting");
  EXPECT_EQ(health_of(CanFacts{.age_s = 0.01, .frames_hz = 100}).state, "ok");
  EXPECT_EQ(health_of(CanFacts{.age_s = 0.01, .frames_hz = 100, .lost_hz = 2}).state, "losing");
  EXPECT_EQ(health_of(CanFacts{.age_s = 3}).state, "silent");
  EXPECT_EQ(health_of(CanFacts{.age_s = 3, .frames_hz = 100}).state, "unreadable");
  EXPECT_EQ(health_of(CanFacts{.frames_hz = 100}).state, "unreadable");
  EXPECT_EQ(health_of(CanFacts{.state = CanState::bus_off, .age_s = 3}).state, "bus-off");
  EXPECT_EQ(health_of(CanFacts{.state = CanState::down, .age_s = 3}).state, "down");
  EXPECT_EQ(health_of(CanFacts{.state = CanState::lost, .age_s = 3}).state, "lost");
}

TEST(Health, of_an_imu_tells_silence_garbage_and_a_device_that_has_gone) {
  EXPECT_EQ(health_of(ImuFacts{}).state, "waiting");
  EXPECT_EQ(health_of(ImuFacts{.age_s = 0.01, .bytes_hz = 4000, .samples_hz = 100}).state, "ok");
  EXPECT_EQ(health_of(ImuFacts{.age_s = 0.01, .bytes_hz = 4000, .samples_hz = 100, .bad_hz = 5}).state, "losing");
  EXPECT_EQ(health_of(ImuFacts{.age_s = 2}).state, "silent");
  EXPECT_EQ(health_of(ImuFacts{.age_s = 2, .bytes_hz = 4000}).state, "unreadable");
  EXPECT_EQ(health_of(ImuFacts{.device_is_lost = true, .age_s = 2}).state, "lost");
}

TEST(Health, of_mapping_names_its_sources_or_what_it_lacks) {
  EXPECT_EQ(health_of(MappingFacts{}).state, "waiting");
  MappingFacts facts{.age_s = 0.1, .speed = MotionSource::wheels, .yaw = MotionSource::imu, .matched = true};
  EXPECT_EQ(health_of(facts).state, "ok");
  EXPECT_EQ(health_of(facts).detail, "speed from wheels, yaw from imu");
  facts.matched = false;
  EXPECT_THAT(health_of(facts).detail, HasSubstr("matches nothing"));
  facts.speed = MotionSource::none;
  EXPECT_EQ(health_of(facts).state, "motionless");
  facts.refused_hz = 1;
  EXPECT_EQ(health_of(facts).state, "behind");
}

TEST(Recent, is_what_has_grown_within_three_seconds) {
  Recent<2> recent;
  EXPECT_EQ(recent.growth(0), 0);
  recent.add(10, {100, 7});
  EXPECT_EQ(recent.rate_hz(0), 0);
  recent.add(11, {110, 7});
  recent.add(11.2, {1000, 7});  // too soon after the one before
  EXPECT_DOUBLE_EQ(recent.rate_hz(0), 10);
  recent.add(12, {120, 7});
  recent.add(13, {160, 7});
  EXPECT_DOUBLE_EQ(recent.rate_hz(0), 20);
  EXPECT_DOUBLE_EQ(recent.newest_hz(0), 40);
  EXPECT_EQ(recent.growth(1), 0);
  for (const double time_s : {14, 15, 16}) recent.add(time_s, {160, 7});
  EXPECT_EQ(recent.growth(0), 0);
}

}  // namespace
}  // namespace roadvec
