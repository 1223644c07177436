#include "tools/simulate/vehicle_logs.h"

#include "drivers/can/can_log_reader.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/imu/log_reader.h"
#include "drivers/imu/xsens.h"
#include "tests/tools/simulate/made_drive.h"

namespace roadvec {
namespace {

/// A left-hand bend of 90 degrees, so that the steering has something to say.
Scene bend_scene() {
  Scene scene = plain_scene();
  scene.road.waypoints = {{{0, 0}, 0}, {{60, 0}, 20}, {{60, 90}, 0}};
  scene.walls.clear();
  scene.car.start_m = 20;
  scene.car.distance_m = 70;
  scene.errors.compass_wander_deg = 0;
  return scene;
}

class VehicleLogs : public testing::Test {
 protected:
  VehicleLogs() : scene_(bend_scene()) {
    const auto path = RoadPath::create(scene_.road);
    motion_.emplace(drive(scene_.car, *path).value());
  }
  template <class Write>
  std::string written(const std::string& name, Write&& write) {
    auto file = OutputFile::create(folder_ / name);
    write(*file);
    EXPECT_TRUE(file->close());
    return (folder_ / name).string();
  }
  [[nodiscard]] double drive_s(SensorTime time) const { return seconds_between({scene_.start_ns}, time); }

  TemporaryFolder folder_;
  Scene scene_;
  std::optional<CarMotion> motion_;
};

TEST_F(VehicleLogs, can_log_decodes_to_the_true_motion_and_the_declared_errors) {
  const std::string log = written("can.log", [&](OutputFile& file) { write_can_log(scene_, *motion_, 30, file); });
  const DbcFile dbc = parse_dbc(vehicle_dbc(Scene{}), "vehicle.dbc");
  EXPECT_TRUE(dbc.diagnostics.empty());
  VehicleSignals signals;
  signals.steering.sum = {"SteeringSensor.SteeringWheelAngle"};
  for (const char* wheel : {"FL", "FR", "RL", "RR"}) {
    signals.wheel_speeds.emplace_back().sum = {std::string("WheelSpeeds.WheelSpeed") + wheel};
  }
  auto decoder = MotionDecoder::create(dbc, signals);
  ASSERT_TRUE(decoder) << decoder.error().message;
  auto reader = CanLogReader::open(log);
  ASSERT_TRUE(reader) << reader.error().message;
  CanFrame frame;
  int steering_count = 0, wheel_count = 0;
  double most_steering_rad = 0, most_difference_mps = 0;
  while ((*reader)->read(frame, std::chrono::milliseconds(0)) == CanReadResult::frame) {
    for (const MotionSample& sample : decoder->decode(frame)) {
      const CarState car = motion_->at(drive_s(sample.time));
      if (const auto* steering = std::get_if<SteeringAngle>(&sample.value)) {
        const double offset_rad = rad_from_deg(scene_.errors.steering_offset_deg);
        EXPECT_NEAR(steering->wheel_rad - offset_rad, car.steering_rad * scene_.car.steering_ratio,
                    rad_from_deg(0.0501));
        most_steering_rad = std::max(most_steering_rad, steering->wheel_rad);
        ++steering_count;
      } else if (const auto* wheels = std::get_if<WheelSpeed>(&sample.value)) {
        const double scale = scene_.errors.wheel_speed_scale, step_mps = 0.00501 / 3.6 / scale;
        EXPECT_NEAR((wheels->rear_left_mps + wheels->rear_right_mps) / 2 / scale, car.speed_mps, step_mps);
        EXPECT_NEAR((wheels->rear_right_mps - wheels->rear_left_mps) / scale, car.yaw_rate_radps * scene_.car.track_m,
                    2 * step_mps);
        // The front axle's middle goes v / cos(steering).
        EXPECT_NEAR((wheels->front_left_mps + wheels->front_right_mps) / 2 / scale,
                    car.speed_mps / std::cos(car.steering_rad), step_mps + 0.002);
        most_difference_mps = std::max(most_difference_mps, wheels->rear_right_mps - wheels->rear_left_mps);
        ++wheel_count;
      }
    }
  }
  EXPECT_EQ(steering_count, 3000);
  EXPECT_EQ(wheel_count, 1500);
  EXPECT_GT(most_steering_rad, rad_from_deg(90));
  EXPECT_GT(most_difference_mps, 0.2);
  EXPECT_EQ((*reader)->counters().bad_line_count, 0U);
}

TEST_F(VehicleLogs, imu_log_decodes_to_the_true_motion_with_bias_and_gravity) {
  const std::string log =
      written("imu.log", [&](OutputFile& file) { write_imu_log(scene_, *motion_, 20, Random(1, 3), file); });
  auto reader = ImuLogReader::open(log);
  ASSERT_TRUE(reader) << reader.error().message;
  XsensDecoder decoder({});
  ImuBytes bytes;
  MotionSample sample;
  double rate_error_radps = 0, up_mps2 = 0, ahead_error_mps2 = 0;
  int count = 0;
  while ((*reader)->read(bytes, std::chrono::milliseconds(0)) == ImuReadResult::bytes) {
    while (decoder.next(bytes, sample)) {
      const CarState car = motion_->at(drive_s(sample.time));
      const auto& imu = std::get<ImuSample>(sample.value);
      ASSERT_TRUE(imu.has_rate && imu.has_acceleration && imu.has_orientation);
      EXPECT_NEAR(wrap_rad(imu.heading_rad - car.pose.theta_rad), 0, 1e-5);
      rate_error_radps += imu.rate_z_radps - car.yaw_rate_radps;
      ahead_error_mps2 += imu.acceleration_x_mps2 - car.acceleration_mps2;
      up_mps2 += imu.acceleration_z_mps2;
      ++count;
    }
  }
  ASSERT_EQ(count, 2000);
  EXPECT_NEAR(rate_error_radps / count, rad_from_deg(scene_.errors.gyro_bias_degps), 2e-4);
  EXPECT_NEAR(ahead_error_mps2 / count, 0, 0.003);
  EXPECT_NEAR(up_mps2 / count, 9.81, 0.003);
  EXPECT_EQ(decoder.counters().bad_checksum_count, 0U);
  EXPECT_EQ(decoder.counters().lost_message_count, 0U);
}

}  // namespace
}  // namespace roadvec
