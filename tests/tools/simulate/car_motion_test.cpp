#include "tools/simulate/car_motion.h"

#include <gtest/gtest.h>

#include "core/base/angle.h"
#include "tools/simulate/scene_file.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {
namespace {

const GroundHeight kLevel = [](const Eigen::Vector2d&) { return 0.0; };

TEST(CarMotion, in_every_shipped_scene_the_car_starts_and_stops_and_keeps_its_limits) {
  for (const ShippedScene& shipped : shipped_scenes()) {
    const Scene scene = load_scene(std::string(shipped.name)).value();
    const RoadPath path = route_of(scene).value();
    const CarMotion motion = drive(scene.car, path, kLevel).value();
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

TEST(CarMotion, poses_are_what_speeds_and_yaw_rate_add_up_to) {
  const Scene scene = load_scene("block").value();
  const CarMotion motion = drive(scene.car, route_of(scene).value(), kLevel).value();
  Pose2 pose = motion.at(0).pose;
  constexpr double kStep_s = 0.002;
  for (double t = 0; t < motion.duration_s(); t += kStep_s) {
    const CarState car = motion.at(t + kStep_s / 2);
    const double turned_rad = car.yaw_rate_radps * kStep_s;
    const Eigen::Vector2d gone_m =
        Eigen::Rotation2Dd(turned_rad / 2) * Eigen::Vector2d(car.speed_mps * kStep_s, car.side_speed_mps * kStep_s);
    pose = pose * Pose2{gone_m.x(), gone_m.y(), turned_rad};
  }
  const Pose2 end = motion.at(motion.duration_s()).pose;
  EXPECT_NEAR(pose.x_m, end.x_m, 0.05);
  EXPECT_NEAR(pose.y_m, end.y_m, 0.05);
}

/// A bend of 90 degrees to the left, 25 m wide, with 40 m before and behind it.
CarMotion bend(CarSpec car, const GroundHeight& ground = kLevel) {
  const RoadPath path = RoadPath::create({{{0, 0}, 0}, {{80, 0}, 25}, {{80, 90}, 0}}, false).value();
  car.distance_m = 110;
  car.side_acceleration_mps2 = 3;
  return drive(car, path, ground).value();
}

TEST(CarMotion, at_speed_the_car_needs_more_steering_than_geometry_and_its_rear_slips_outwards) {
  CarSpec car;
  const CarMotion slipping = bend(car);
  double most_side_mps2 = 0;
  CarState fastest;
  for (double t = 0; t < slipping.duration_s(); t += 0.01) {
    if (const CarState state = slipping.at(t); state.side_acceleration_mps2 > most_side_mps2) {
      most_side_mps2 = state.side_acceleration_mps2;
      fastest = state;
    }
  }
  ASSERT_GT(most_side_mps2, 2.0);
  const double geometric_radps = fastest.speed_mps * std::tan(fastest.steering_rad) / car.wheelbase_m;
  EXPECT_LT(fastest.yaw_rate_radps, 0.97 * geometric_radps);
  EXPECT_NEAR(fastest.side_speed_mps / fastest.speed_mps,
              -car.rear_slip_rad_per_mps2 * fastest.speed_mps * fastest.yaw_rate_radps, 1e-9);
  EXPECT_LT(fastest.side_speed_mps, -0.05);
  car.understeer_rad_per_mps2 = car.rear_slip_rad_per_mps2 = 0;
  const CarMotion rolling = bend(car);
  for (double t = 0; t < rolling.duration_s(); t += 0.1) {
    const CarState state = rolling.at(t);
    EXPECT_NEAR(state.yaw_rate_radps, state.speed_mps * std::tan(state.steering_rad) / car.wheelbase_m, 1e-4);
    EXPECT_EQ(state.side_speed_mps, 0);
  }
}

TEST(CarMotion, acceleration_changes_no_faster_than_the_jerk_allows_but_at_the_halt) {
  const CarSpec car;
  const CarMotion motion = bend(car);
  for (double t = 0; t + 0.01 < motion.duration_s(); t += 0.01) {
    const CarState a = motion.at(t), b = motion.at(t + 0.01);
    if (b.speed_mps == 0) continue;
    EXPECT_LE(std::abs(b.acceleration_mps2 - a.acceleration_mps2), 0.01 * car.jerk_mps3 + 1e-9) << t;
  }
}

TEST(CarMotion, the_nose_dives_under_hard_braking_and_the_body_leans_out_of_curves) {
  CarSpec car;
  car.acceleration_mps2 = 5;
  car.jerk_mps3 = 20;
  car.speed_mps = 12;
  const CarMotion motion = bend(car);
  double deepest_rad = 0, highest_rad = 0, most_left_up_rad = 0;
  for (double t = 0; t < motion.duration_s(); t += 0.01) {
    const CarState state = motion.at(t);
    deepest_rad = std::max(deepest_rad, state.pitch_rad);
    highest_rad = std::min(highest_rad, state.pitch_rad);
    most_left_up_rad = std::max(most_left_up_rad, state.roll_rad);
  }
  EXPECT_NEAR(deg_from_rad(deepest_rad), 1.5, 0.5);
  EXPECT_NEAR(deg_from_rad(highest_rad), -1.5, 0.5);
  EXPECT_GT(deg_from_rad(most_left_up_rad), 0.4 * 2) << "a left-hand bend";
}

TEST(CarMotion, on_a_climb_the_body_lies_as_the_road_does_and_the_way_is_longer_than_on_the_map) {
  const double grade = 0.08;
  const CarMotion motion = bend({}, [&](const Eigen::Vector2d& point_m) { return grade * point_m.x(); });
  const double end_s = 8.0;  // on the straight before the bend, at constant speed
  double way_m = 0;
  for (double t = 0; t < end_s; t += CarMotion::kStep_s) way_m += motion.at(t).speed_mps * CarMotion::kStep_s;
  const CarState state = motion.at(end_s);
  ASSERT_LT(state.pose.x_m, 50);
  EXPECT_NEAR(state.pitch_rad, -std::atan(grade), rad_from_deg(0.1));
  EXPECT_NEAR(state.z_m, grade * state.pose.x_m, 0.01);
  EXPECT_NEAR(way_m / state.pose.x_m, std::sqrt(1 + grade * grade), 5e-4);
}

TEST(CarMotion, the_car_stays_near_its_lane) {
  const Scene scene = load_scene("street").value();
  const RoadPath path = route_of(scene).value();
  const CarMotion motion = drive(scene.car, path, kLevel).value();
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
  EXPECT_FALSE(drive(car, route_of(scene).value(), kLevel));
}

}  // namespace
}  // namespace roadvec
