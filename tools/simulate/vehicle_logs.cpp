#include "tools/simulate/vehicle_logs.h"

#include <array>
#include <cmath>

#include "core/base/angle.h"
#include "tools/recording/car_messages.h"
#include "tools/recording/xsens_message.h"

namespace roadvec {
namespace {

constexpr double kTick_s = 0.01;
/// When in a tick the two messages go out; an ECU is in step with nothing else.
constexpr double kSteeringSent_s = 0.0013, kWheelsSent_s = 0.0037;
constexpr double kGravity_mps2 = 9.81;

SensorTime instant(const Scene& scene, double time_s) { return {scene.start_ns + std::llround(time_s * 1e6) * 1000}; }

CarMessageSteps steps_of(const Scene& scene) {
  return {.steering_deg = scene.errors.steering_step_deg, .wheel_speed_kmph = scene.errors.wheel_speed_step_kmph};
}

std::string steering_frame(const Scene& scene, const CarState& car, unsigned counter) {
  const double wheel_deg = deg_from_rad(car.steering_rad) * scene.car.steering_ratio + scene.errors.steering_offset_deg;
  return steering_frame(steps_of(scene), wheel_deg, counter);
}

std::string wheel_frame(const Scene& scene, const CarState& car) {
  std::array<double, 4> speeds_mps =
      wheel_speeds_mps(scene.car.wheelbase_m, scene.car.track_m, car.speed_mps, car.yaw_rate_radps);
  for (double& speed_mps : speeds_mps) speed_mps *= scene.errors.wheel_speed_scale;
  return wheel_frame(steps_of(scene), speeds_mps);
}

}  // namespace

std::string vehicle_dbc(const Scene& scene) { return vehicle_dbc(steps_of(scene)); }

std::uint64_t write_can_log(const Scene& scene, const CarMotion& motion, double duration_s, OutputFile& file) {
  std::uint64_t frame_count = 0;
  const auto send = [&](double time_s, const std::string& frame) {
    file.write(print("(%s) can0 %s\n", stamp(instant(scene, time_s)).c_str(), frame.c_str()));
    ++frame_count;
  };
  for (unsigned tick = 0; tick * kTick_s + kWheelsSent_s < duration_s; ++tick) {
    const double steering_s = tick * kTick_s + kSteeringSent_s, wheels_s = tick * kTick_s + kWheelsSent_s;
    send(steering_s, steering_frame(scene, motion.at(steering_s), tick));
    if (tick % 2 == 0) send(wheels_s, wheel_frame(scene, motion.at(wheels_s)));
  }
  return frame_count;
}

std::uint64_t write_imu_log(const Scene& scene, const CarMotion& motion, double duration_s, Random random,
                            OutputFile& file) {
  const ErrorSpec& errors = scene.errors;
  const double memory = kTick_s / errors.compass_wander_s;
  double wander_rad = rad_from_deg(errors.compass_wander_deg) * random.normal();
  std::uint64_t tick = 0;
  for (; static_cast<double>(tick) * kTick_s < duration_s; ++tick) {
    const double time_s = static_cast<double>(tick) * kTick_s;
    const CarState car = motion.at(time_s);
    // A first-order Gauss-Markov process: what a compass makes of steel in the street.
    wander_rad +=
        -memory * wander_rad + rad_from_deg(errors.compass_wander_deg) * std::sqrt(2 * memory) * random.normal();
    const double heading_rad = car.pose.theta_rad + wander_rad;
    const auto noise = [&](double sigma) { return sigma * random.normal(); };
    XsensMessage message;
    message.datum(0x1020, 2);
    message.put(static_cast<std::uint32_t>(tick & 0xFFFF), 2);
    message.datum(0x1060, 4);
    message.put(static_cast<std::uint32_t>(tick * 100), 4);  // SampleTimeFine counts 0.1 ms
    message.floats(0x2010, {std::cos(heading_rad / 2), 0, 0, std::sin(heading_rad / 2)});
    const double ax = car.acceleration_mps2 + noise(errors.acceleration_noise_mps2);
    const double ay = car.speed_mps * car.yaw_rate_radps + noise(errors.acceleration_noise_mps2);
    const double az = kGravity_mps2 + noise(errors.acceleration_noise_mps2);
    message.floats(0x4020, {ax, ay, az});
    const double rate_x = noise(errors.gyro_noise_radps), rate_y = noise(errors.gyro_noise_radps);
    const double bias_radps = rad_from_deg(errors.gyro_bias_degps);
    message.floats(0x8020, {rate_x, rate_y, car.yaw_rate_radps + bias_radps + noise(errors.gyro_noise_radps)});
    message.datum(0xE020, 4);
    message.put(3, 4);
    file.write(print("(%s) %s\n", stamp(instant(scene, time_s)).c_str(), message.hex().c_str()));
  }
  return tick;
}

}  // namespace roadvec
