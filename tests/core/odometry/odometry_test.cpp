#include "core/odometry/odometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace roadvec {
namespace {

constexpr VehicleGeometry kCar{.wheelbase_m = 2.7, .track_m = 1.55, .steering_ratio = 15};
constexpr std::int64_t kSecond_ns = 1'000'000'000;

SensorTime at_s(double s) { return {static_cast<std::int64_t>(std::llround(s * 1e9))}; }

/// A car that drives a circle (or straight on): what its sensors say, with their errors.
struct Drive {
  double speed_mps = 10, yaw_rate_radps = 0, gyro_bias_radps = 0, speed_scale = 0, steering_offset_rad = 0;
  bool wheels = true, steering = true, gyro = true;

  [[nodiscard]] std::vector<MotionSample> samples(double from_s, double to_s) const {
    std::vector<MotionSample> result;
    for (double t = from_s + 0.01; t <= to_s + 1e-9; t += 0.01) {
      const double v = speed_mps / (1 + speed_scale);
      if (wheels) result.push_back({at_s(t), WheelSpeed{v, v, v, v}});
      const double road_wheel = speed_mps > 0 ? std::atan(yaw_rate_radps * kCar.wheelbase_m / speed_mps) : 0.0;
      if (steering)
        result.push_back({at_s(t), SteeringAngle{(road_wheel - steering_offset_rad) * kCar.steering_ratio}});
      if (gyro) {
        ImuSample imu;
        imu.rate_z_radps = yaw_rate_radps + gyro_bias_radps;
        imu.has_rate = true;
        result.push_back({at_s(t), imu});
      }
    }
    return result;
  }
  [[nodiscard]] Pose2 truth(double t_s) const {
    const double theta = yaw_rate_radps * t_s;
    if (yaw_rate_radps == 0) return {speed_mps * t_s, 0, 0};
    const double r = speed_mps / yaw_rate_radps;
    return {r * std::sin(theta), r * (1 - std::cos(theta)), wrap_rad(theta)};
  }
};

Pose2 driven(const Drive& drive, double seconds) {
  Odometry odometry({}, kCar);
  odometry.integrate(drive.samples(0, seconds), at_s(0), at_s(seconds));
  return odometry.pose();
}

TEST(Odometry, follows_a_circle_from_wheels_and_gyro) {
  const Drive drive{.yaw_rate_radps = 0.2};
  const Pose2 end = driven(drive, 10), truth = drive.truth(10);
  EXPECT_NEAR(end.x_m, truth.x_m, 0.15);  // the first 10 ms have no inputs yet
  EXPECT_NEAR(end.y_m, truth.y_m, 0.15);
  EXPECT_NEAR(end.theta_rad, truth.theta_rad, 0.01);
}

TEST(Odometry, falls_back_to_steering_without_an_imu) {
  const Drive drive{.yaw_rate_radps = 0.2, .gyro = false};
  const Pose2 end = driven(drive, 5), truth = drive.truth(5);
  EXPECT_NEAR(end.theta_rad, truth.theta_rad, 0.02);
  EXPECT_NEAR((end.translation() - truth.translation()).norm(), 0, 0.3);
}

TEST(Odometry, finds_the_gyro_bias_while_standing_still) {
  const Drive drive{.speed_mps = 0, .gyro_bias_radps = 0.0015, .steering = false};
  Odometry odometry({}, kCar);
  odometry.integrate(drive.samples(0, 10), at_s(0), at_s(10));
  EXPECT_NEAR(odometry.gyro_bias_radps(), 0.0015, 0.0003);
}

TEST(Odometry, keeps_its_heading_while_standing_whatever_gyro_and_compass_say) {
  Odometry odometry({}, kCar);
  std::vector<MotionSample> samples = Drive{.speed_mps = 0, .gyro_bias_radps = 0.0015}.samples(0, 60);
  for (MotionSample& sample : samples) {
    if (auto* imu = std::get_if<ImuSample>(&sample.value)) {
      imu->has_orientation = true;
      imu->heading_rad = 1.0 + 0.02 * std::sin(0.1 * seconds_between(at_s(0), sample.time));
    }
  }
  const std::size_t count = samples.size() / 60;
  odometry.integrate(std::span(samples).first(count), at_s(0), at_s(1));
  const Eigen::Vector3d before = odometry.pose_covariance().diagonal();
  odometry.integrate(std::span(samples).subspan(count), at_s(1), at_s(60));
  EXPECT_NEAR(odometry.pose().theta_rad, 0, 1e-4);
  EXPECT_LT((Eigen::Vector3d(odometry.pose_covariance().diagonal()) - before).maxCoeff(), 1e-4);
}

TEST(Odometry, turns_with_the_gyro_where_coarse_wheel_signals_still_read_zero) {
  Drive drive{.speed_mps = 0, .yaw_rate_radps = 0.05};
  EXPECT_NEAR(driven(drive, 1).theta_rad, 0.05, 0.005);
}

TEST(Odometry, finds_bias_scale_and_offset_from_matches) {
  const Drive drive{.yaw_rate_radps = 0.1, .gyro_bias_radps = 0.001, .speed_scale = 0.01, .steering_offset_rad = 0.004};
  Odometry odometry({}, kCar);
  const Eigen::Matrix3d information = Eigen::Vector3d(1e4, 1e4, 1e6).asDiagonal();
  for (int k = 0; k < 300; ++k) {
    odometry.integrate(drive.samples(0.1 * k, 0.1 * (k + 1)), at_s(0.1 * k), at_s(0.1 * (k + 1)));
    odometry.correct(drive.truth(0.1 * (k + 1)), information);
  }
  EXPECT_NEAR(odometry.gyro_bias_radps(), 0.001, 0.0002);
  EXPECT_NEAR(odometry.speed_scale(), 0.01, 0.002);
  EXPECT_NEAR(odometry.steering_offset_rad(), 0.004, 0.002);
}

TEST(Odometry, matches_from_one_place_are_worth_little_more_than_one) {
  // Five sweeps tell the same lie of half a degree.
  const auto heading_after = [](double speed_mps) {
    const Drive drive{.speed_mps = speed_mps};
    Odometry odometry({}, kCar);
    const Eigen::Matrix3d information = Eigen::Vector3d(1e2, 1e2, 1e4).asDiagonal();
    for (int i = 0; i < 5; ++i) {
      odometry.integrate(drive.samples(0.1 * i, 0.1 * (i + 1)), at_s(0.1 * i), at_s(0.1 * (i + 1)));
      const Pose2 now = odometry.pose();
      odometry.correct(Pose2{now.x_m, now.y_m, rad_from_deg(0.5)}, information);
    }
    return deg_from_rad(odometry.pose().theta_rad);
  };
  EXPECT_LT(heading_after(0.5), 0.6 * heading_after(10));
}

TEST(Odometry, turns_the_rates_of_a_tilted_car_into_the_plane) {
  constexpr double kPitch_rad = -0.2, kRoll_rad = 0.1, kYawRate_radps = 0.3;  // up a ramp, leaning
  ImuSample imu;
  imu.has_rate = imu.has_orientation = true;
  imu.roll_rad = kRoll_rad;
  imu.pitch_rad = kPitch_rad;
  imu.rate_x_radps = -kYawRate_radps * std::sin(kPitch_rad);
  imu.rate_y_radps = kYawRate_radps * std::cos(kPitch_rad) * std::sin(kRoll_rad);
  imu.rate_z_radps = kYawRate_radps * std::cos(kPitch_rad) * std::cos(kRoll_rad);
  std::vector<MotionSample> motion;
  for (int i = 0; i <= 200; ++i) {
    motion.push_back({at_s(0.01 * i), WheelSpeed{5, 5, 5, 5}});
    imu.heading_rad = kYawRate_radps * 0.01 * i;
    motion.push_back({at_s(0.01 * i), imu});
  }
  Odometry odometry({}, kCar);
  odometry.integrate(motion, at_s(0), at_s(2));
  EXPECT_NEAR(odometry.pose().theta_rad, 2 * kYawRate_radps, 0.001);
  EXPECT_NEAR(odometry.speed_mps(), 5 * std::cos(kPitch_rad), 0.01);
}

TEST(Odometry, a_match_that_saw_one_direction_corrects_that_direction_alone) {
  Odometry odometry({}, kCar);
  const Drive drive;
  odometry.integrate(drive.samples(0, 5), at_s(0), at_s(5));
  const Pose2 before = odometry.pose();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  information(1, 1) = 1e4;  // across the road
  odometry.correct(Pose2{before.x_m + 5, before.y_m + 0.2, before.theta_rad}, information);
  EXPECT_NEAR(odometry.pose().x_m, before.x_m, 0.05);
  EXPECT_GT(odometry.pose().y_m, before.y_m + 0.1);
}

TEST(Odometry, covariance_grows_along_the_road_until_a_match_shrinks_it) {
  Odometry odometry({}, kCar);
  const Drive drive;
  odometry.integrate(drive.samples(0, 1), at_s(0), at_s(1));
  const double after_1_s = odometry.pose_covariance()(0, 0);
  odometry.integrate(drive.samples(1, 5), at_s(1), at_s(5));
  EXPECT_GT(odometry.pose_covariance()(0, 0), 3 * after_1_s);
  odometry.correct(odometry.pose(), Eigen::Matrix3d::Identity() * 1e6);
  EXPECT_LT(odometry.pose_covariance()(0, 0), after_1_s);
}

TEST(Odometry, coasts_on_matches_when_can_and_imu_are_silent) {
  Odometry odometry({}, kCar);
  const Drive drive;
  const Eigen::Matrix3d information = Eigen::Matrix3d::Identity() * 1e4;
  odometry.integrate(drive.samples(0, 1), at_s(0), at_s(1));
  odometry.correct(drive.truth(1), information);
  for (int k = 11; k < 40; ++k) {
    odometry.integrate({}, at_s(0.1 * k), at_s(0.1 * (k + 1)));
    EXPECT_NEAR(odometry.pose().x_m, drive.truth(0.1 * (k + 1)).x_m, 0.4) << k;
    odometry.correct(drive.truth(0.1 * (k + 1)), information);
  }
  EXPECT_EQ(odometry.speed_source(), MotionSource::matching);
}

TEST(Odometry, stands_where_it_is_without_any_input) {
  Odometry odometry({}, kCar);
  odometry.integrate({}, at_s(0), at_s(1));
  EXPECT_EQ(odometry.pose(), Pose2{});
  EXPECT_EQ(odometry.speed_source(), MotionSource::none);
}

TEST(Odometry, late_samples_never_turn_time_back) {
  Odometry odometry({}, kCar);
  const Drive drive;
  odometry.integrate(drive.samples(0, 1), at_s(0), at_s(1));
  const double x_m = odometry.pose().x_m;
  const std::vector<MotionSample> late = drive.samples(0.5, 0.7);
  odometry.integrate(late, at_s(1), at_s(1) + kSecond_ns / 10);
  EXPECT_GT(odometry.pose().x_m, x_m);
  EXPECT_EQ(odometry.time(), at_s(1) + kSecond_ns / 10);
}

TEST(Odometry, a_clock_that_is_set_moves_no_car) {
  for (const double step_s : {3600.0, -3600.0, 2.5, -2.5}) {
    Odometry odometry({}, kCar);
    const Drive drive{.yaw_rate_radps = 0.1};
    odometry.integrate(drive.samples(0, 1), at_s(0), at_s(1));
    const double sigma2 = odometry.pose_covariance()(0, 0);
    std::vector<MotionSample> later = drive.samples(1, 3);
    for (MotionSample& sample : later) sample.time = sample.time + at_s(step_s).ns;
    const Path& path = odometry.integrate(later, at_s(1 + step_s), at_s(3 + step_s));
    EXPECT_EQ(odometry.time(), at_s(3 + step_s));
    const Pose2 truth = drive.truth(3);
    EXPECT_NEAR(odometry.pose().x_m, truth.x_m, 0.3) << step_s;
    EXPECT_NEAR(odometry.pose().y_m, truth.y_m, 0.1) << step_s;
    EXPECT_GT(odometry.pose_covariance()(0, 0), sigma2 + 0.9) << step_s;
    EXPECT_NEAR(path.at(at_s(2 + step_s)).x_m, drive.truth(2).x_m, 0.3) << step_s;
    EXPECT_EQ(odometry.speed_source(), MotionSource::wheels) << step_s;
  }
}

TEST(Odometry, path_covers_the_sweep) {
  Odometry odometry({}, kCar);
  const Drive drive;
  odometry.integrate(drive.samples(0, 1), at_s(0), at_s(1));
  const Path& path = odometry.integrate(drive.samples(1, 1.1), at_s(1), at_s(1.1));
  EXPECT_LE(path.start().time, at_s(1));
  EXPECT_EQ(path.end().time, at_s(1.1));
  EXPECT_NEAR(path.at(at_s(1.05)).x_m - path.at(at_s(1.0)).x_m, 0.5, 0.01);
}

}  // namespace
}  // namespace roadvec
