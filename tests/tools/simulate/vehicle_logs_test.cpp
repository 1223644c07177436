#include "tools/simulate/vehicle_logs.h"

#include <set>

#include "drivers/can/can_log_reader.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/imu/log_reader.h"
#include "drivers/imu/xsens.h"
#include "tests/tools/simulate/made_drive.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {
namespace {

/// A left-hand bend of 90 degrees, so that the steering has something to say.
Scene bend_scene() {
  Scene scene = plain_scene();
  scene.roads.front().waypoints = {{{0, 0}, 0}, {{60, 0}, 20}, {{60, 90}, 0}};
  scene.roads.front().walls.clear();
  scene.car.start_m = 20;
  scene.car.distance_m = 70;
  scene.errors.compass_wander_deg = scene.errors.compass_soft_iron_deg = 0;
  scene.errors.can_latency_ms = scene.errors.can_jitter_ms = 0;
  scene.errors.wheel_radius_spread = 0;
  return scene;
}

/// Of steering and wheels, by the DBC that comes with the drive.
MotionDecoder decoder_of(const Scene& scene) {
  const DbcFile dbc = parse_dbc(vehicle_dbc(scene), "vehicle.dbc");
  EXPECT_TRUE(dbc.diagnostics.empty());
  VehicleSignals signals;
  signals.steering.sum = {"SteeringSensor.SteeringWheelAngle"};
  for (const char* wheel : {"FL", "FR", "RL", "RR"}) {
    signals.wheel_speeds.emplace_back().sum = {std::string("WheelSpeeds.WheelSpeed") + wheel};
  }
  return MotionDecoder::create(dbc, signals).value();
}

class VehicleLogs : public testing::Test {
 protected:
  VehicleLogs() : scene_(bend_scene()) {
    const auto path = route_of(scene_);
    motion_.emplace(drive(scene_.car, *path, [](const Eigen::Vector2d&) { return 0.0; }).value());
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
  const std::string log =
      written("can.log", [&](OutputFile& file) { write_can_log(scene_, *motion_, 30, Random(1, 4), file); });
  MotionDecoder decoder = decoder_of(Scene{});
  auto reader = CanLogReader::open(log);
  ASSERT_TRUE(reader) << reader.error().message;
  CanFrame frame;
  int steering_count = 0, wheel_count = 0;
  double most_steering_rad = 0, most_difference_mps = 0;
  while ((*reader)->read(frame, std::chrono::milliseconds(0)) == CanReadResult::frame) {
    for (const MotionSample& sample : decoder.decode(frame)) {
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
        // The front axle's middle goes where it is steered, but for the slip.
        const double front_left_mps = car.side_speed_mps + car.yaw_rate_radps * scene_.car.wheelbase_m;
        const double along_mps =
            car.speed_mps * std::cos(car.steering_rad) + front_left_mps * std::sin(car.steering_rad);
        EXPECT_NEAR((wheels->front_left_mps + wheels->front_right_mps) / 2 / scale, along_mps, step_mps + 0.002);
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

TEST_F(VehicleLogs, signals_come_in_the_steps_asked_for_such_as_the_papers_cars_one_degree_and_one_kmph) {
  scene_.errors.steering_step_deg = 1;
  scene_.errors.wheel_speed_step_kmph = 1;
  const std::string log =
      written("can.log", [&](OutputFile& file) { write_can_log(scene_, *motion_, 10, Random(1, 4), file); });
  MotionDecoder decoder = decoder_of(scene_);
  auto reader = CanLogReader::open(log);
  ASSERT_TRUE(reader) << reader.error().message;
  std::set<long> angles_deg, speeds_kmph;
  CanFrame frame;
  while ((*reader)->read(frame, std::chrono::milliseconds(0)) == CanReadResult::frame) {
    for (const MotionSample& sample : decoder.decode(frame)) {
      if (const auto* steering = std::get_if<SteeringAngle>(&sample.value)) {
        const double deg = deg_from_rad(steering->wheel_rad);
        angles_deg.insert(std::lround(deg));
        EXPECT_NEAR(deg, std::round(deg), 1e-6);
      } else if (const auto* wheels = std::get_if<WheelSpeed>(&sample.value)) {
        const double kmph = 3.6 * wheels->rear_left_mps;
        speeds_kmph.insert(std::lround(kmph));
        EXPECT_NEAR(kmph, std::round(kmph), 1e-6);
      }
    }
  }
  EXPECT_GT(angles_deg.size(), 20U);
  EXPECT_GT(speeds_kmph.size(), 10U);
}

std::vector<double> stamps_of(const std::string& log, const std::string& id) {
  std::ifstream file(log);
  std::vector<double> stamps;
  std::string stamp, interface, frame;
  while (file >> stamp >> interface >> frame) {
    if (frame.starts_with(id)) stamps.push_back(std::stod(stamp.substr(1)));
  }
  return stamps;
}

TEST_F(VehicleLogs, frames_come_late_and_unevenly_but_in_order) {
  const auto write = [&](OutputFile& file) { write_can_log(scene_, *motion_, 10, Random(1, 4), file); };
  const std::vector<double> prompt = stamps_of(written("prompt.log", write), "0C2");
  scene_.errors.can_latency_ms = 30;
  scene_.errors.can_jitter_ms = 8;
  const std::vector<double> late = stamps_of(written("late.log", write), "0C2"),
                            all = stamps_of((folder_ / "late.log").string(), "");
  ASSERT_EQ(late.size(), prompt.size());
  double least_s = 1, most_s = 0;
  for (std::size_t i = 0; i < late.size(); ++i) {
    least_s = std::min(least_s, late[i] - prompt[i]);
    most_s = std::max(most_s, late[i] - prompt[i]);
  }
  EXPECT_GE(least_s, 0.0299);
  EXPECT_LT(least_s, 0.033);
  EXPECT_GT(most_s, 0.045);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end()));
  EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end()) << "two frames at once on one bus";
}

/// What the IMU's messages say, in order.
std::vector<ImuSample> samples_of(const std::string& log) {
  auto reader = ImuLogReader::open(log);
  EXPECT_TRUE(reader) << reader.error().message;
  XsensDecoder decoder({});
  ImuBytes bytes;
  MotionSample sample;
  std::vector<ImuSample> samples;
  while ((*reader)->read(bytes, std::chrono::milliseconds(0)) == ImuReadResult::bytes) {
    while (decoder.next(bytes, sample)) samples.push_back(std::get<ImuSample>(sample.value));
  }
  EXPECT_EQ(decoder.counters().bad_checksum_count, 0U);
  EXPECT_EQ(decoder.counters().lost_message_count, 0U);
  return samples;
}

TEST_F(VehicleLogs, imu_log_decodes_to_force_and_rates_of_the_true_motion_with_bias) {
  scene_.errors.acceleration_noise_mps2 = scene_.errors.gyro_noise_radps = 0;
  const std::vector<ImuSample> samples = samples_of(
      written("imu.log", [&](OutputFile& file) { write_imu_log(scene_, *motion_, 20, Random(1, 3), file); }));
  ASSERT_EQ(samples.size(), 2000U);
  double most_pitch_rad = 0;
  for (std::size_t i = 10; i + 10 < samples.size(); ++i) {
    // From the poses alone: forces by second differences, rates by first ones.
    constexpr double h_s = 0.02;
    const auto T = [&](double after_s) {
      return motion_->at(0.01 * static_cast<double>(i) + after_s).T_scene_vehicle();
    };
    const Eigen::Vector3d a_mps2 =
        (T(h_s).translation() - 2 * T(0).translation() + T(-h_s).translation()) / (h_s * h_s);
    const Eigen::Vector3d f_mps2 = T(0).linear().transpose() * (a_mps2 + Eigen::Vector3d(0, 0, 9.81));
    const Eigen::AngleAxisd turn((T(-h_s / 2).linear().transpose() * T(h_s / 2).linear()).eval());
    const Eigen::Vector3d w_radps = turn.axis() * turn.angle() / h_s;
    const CarState car = motion_->at(0.01 * static_cast<double>(i));
    most_pitch_rad = std::max(most_pitch_rad, std::abs(car.pitch_rad));
    EXPECT_NEAR(wrap_rad(samples[i].heading_rad - car.pose.theta_rad), 0, 1e-4);
    EXPECT_NEAR(samples[i].rate_z_radps, w_radps.z() + rad_from_deg(scene_.errors.gyro_bias_degps), 2e-3);
    if (car.speed_mps < 0.5) continue;  // the jolt of the halt lasts less than the differences
    EXPECT_NEAR(samples[i].acceleration_x_mps2, f_mps2.x(), 0.12) << i;
    EXPECT_NEAR(samples[i].acceleration_z_mps2, f_mps2.z(), 0.12) << i;
  }
  EXPECT_GT(most_pitch_rad, rad_from_deg(0.8));
}

TEST_F(VehicleLogs, noise_averages_out_and_soft_iron_comes_back_twice_in_a_turn) {
  scene_.errors.compass_soft_iron_deg = 2;
  const auto heading_errors_deg = [&](double heading_rad) {
    std::vector<CarState> states(2000);
    for (CarState& state : states) state.pose.theta_rad = heading_rad;
    const CarMotion standing(std::move(states));
    const std::vector<ImuSample> samples =
        samples_of(written("imu" + std::to_string(heading_rad),
                           [&](OutputFile& file) { write_imu_log(scene_, standing, 1.5, Random(1, 3), file); }));
    double up_mps2 = 0;
    for (const ImuSample& sample : samples) up_mps2 += sample.acceleration_z_mps2 / static_cast<double>(samples.size());
    EXPECT_NEAR(up_mps2, 9.81, 0.01);
    return deg_from_rad(wrap_rad(samples.front().heading_rad - heading_rad));
  };
  const double at_0 = heading_errors_deg(0), at_45 = heading_errors_deg(kPi / 4), at_90 = heading_errors_deg(kPi / 2);
  EXPECT_NEAR(at_0, -at_90, 1e-3);
  EXPECT_NEAR(at_0, heading_errors_deg(kPi), 1e-3);
  EXPECT_NEAR(std::hypot(at_0, at_45), 2.0, 1e-3);
}

}  // namespace
}  // namespace roadvec
