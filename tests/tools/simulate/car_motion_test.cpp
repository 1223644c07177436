#include "tools/simulate/car_motion.h"

#include <gtest/gtest.h>

#include "tools/simulate/scene_file.h"

namespace roadvec {
namespace {

TEST(CarMotion, in_every_shipped_scene_the_car_starts_and_stops_and_keeps_its_limits) {
  for (const ShippedScene& shipped : shipped_scenes()) {
    const Scene scene = load_scene(std::string(shipped.name)).value();
    const RoadPath path = RoadPath::create(scene.road).value();
    const CarMotion motion = drive(scene.car, path).value();
    EXPECT_EQ(motion.at(0).speed_mps, 0);
    EXPECT_EQ(motion.at(motion.duration_s()).speed_mps, 0);
    double fastest_mps = 0, steering_before_rad = motion.at(0).steering_rad;
    for (double t = 0; t < motion.duration_s(); t += 0.01) {
      const CarState car = motion.at(t);
      fastest_mps = std::max(fastest_mps, car.speed_mps);
      EXPECT_LE(std::abs(car.acceleration_mps2), scene.car.acceleration_mps2 + 1e-9);
      EXPECT_LE(std::abs(car.speed_mps * car.yaw_rate_radps), 1.3 * scene.car.side_acceleration_mps2)
          << shipped.name << t;
      EXPECT_LE(std::abs(car.steering_rad - steering_before_rad), 0.01 * 0.6 + 1e-9);
      steering_before_rad = car.steering_rad;
    }
    EXPECT_GT(fastest_mps, 0.95 * scene.car.speed_mps);
    EXPECT_LE(fastest_mps, scene.car.speed_mps + 0.01);
  }
}

TEST(CarMotion, poses_are_what_speed_and_yaw_rate_add_up_to) {
  const Scene scene = load_scene("block").value();
  const CarMotion motion = drive(scene.car, RoadPath::create(scene.road).value()).value();
  Pose2 pose = motion.at(0).pose;
  constexpr double kStep_s = 0.002;
  for (double t = 0; t < motion.duration_s(); t += kStep_s) {
    const CarState car = motion.at(t + kStep_s / 2);
    const double turned_rad = car.yaw_rate_radps * kStep_s, gone_m = car.speed_mps * kStep_s;
    pose = pose * Pose2{gone_m * std::cos(turned_rad / 2), gone_m * std::sin(turned_rad / 2), turned_rad};
    EXPECT_NEAR(car.yaw_rate_radps, car.speed_mps * std::tan(car.steering_rad) / scene.car.wheelbase_m, 1e-4);
  }
  const Pose2 end = motion.at(motion.duration_s()).pose;
  EXPECT_NEAR(pose.x_m, end.x_m, 0.05);
  EXPECT_NEAR(pose.y_m, end.y_m, 0.05);
}

TEST(CarMotion, the_car_stays_near_its_lane) {
  const Scene scene = load_scene("street").value();
  const RoadPath path = RoadPath::create(scene.road).value();
  const CarMotion motion = drive(scene.car, path).value();
  for (double t = 0; t < motion.duration_s(); t += 0.1) {
    double nearest_m = 1e9;
    for (double s = 0; s < path.length_m(); s += 0.1) {
      nearest_m = std::min(nearest_m, (path.beside(s, scene.car.lane_m) - motion.at(t).pose.translation()).norm());
    }
    EXPECT_LT(nearest_m, 0.2);
  }
}

TEST(CarMotion, a_drive_past_the_end_of_the_road_is_refused) {
  const Scene scene = load_scene("street").value();
  CarSpec car = scene.car;
  car.distance_m = 1000;
  EXPECT_FALSE(drive(car, RoadPath::create(scene.road).value()));
}

}  // namespace
}  // namespace roadvec
