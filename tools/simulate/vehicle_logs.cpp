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
constexpr double kFrame_s = 0.00025;  ///< 8 bytes at 500 kbit/s
constexpr double kGravity_mps2 = 9.81;

SensorTime instant(const Scene& scene, double time_s) { return {scene.start_ns + std::llround(time_s * 1e6) * 1000}; }

CarMessageSteps steps_of(const Scene& scene) {
  return {.steering_deg = scene.errors.steering_step_deg, .wheel_speed_kmph = scene.errors.wheel_speed_step_kmph};
}

std::string steering_frame(const Scene& scene, const CarState& car, unsigned counter) {
  const double wheel_deg = deg_from_rad(car.steering_rad) * scene.car.steering_ratio + scene.errors.steering_offset_deg;
  return steering_frame(steps_of(scene), wheel_deg, counter);
}

using WheelScales = std::array<double, 4>;

/// Each wheel rolls as fast as its own place on the car goes in the wheel's direction.
std::string wheel_frame(const Scene& scene, const CarState& car, const WheelScales& scales) {
  const double half_m = scene.car.track_m / 2, ahead_m = scene.car.wheelbase_m;
  const std::array<Eigen::Vector2d, 4> wheels_m{{{ahead_m, half_m}, {ahead_m, -half_m}, {0, half_m}, {0, -half_m}}};
  std::array<double, 4> speeds_mps{};
  for (std::size_t i = 0; i < wheels_m.size(); ++i) {
    const double w = car.yaw_rate_radps, steering_rad = wheels_m[i].x() > 0 ? car.steering_rad : 0;
    const double ahead_mps = car.speed_mps - w * wheels_m[i].y(), left_mps = car.side_speed_mps + w * wheels_m[i].x();
    speeds_mps[i] = scales[i] * (ahead_mps * std::cos(steering_rad) + left_mps * std::sin(steering_rad));
  }
  return wheel_frame(steps_of(scene), speeds_mps);
}

/// What a compass makes of steel: slow wander from the street's (a first-order Gauss-Markov process), and twice in a
/// turn the car's own.
class CompassError {
 public:
  CompassError(const ErrorSpec& errors, Random& random)
      : errors_(errors),
        random_(random),
        wander_rad_(rad_from_deg(errors.compass_wander_deg) * random.normal()),
        soft_iron_at_rad_(kPi * random.uniform()) {}

  double next_rad(double heading_rad) {
    const double memory = kTick_s / errors_.compass_wander_s;
    wander_rad_ +=
        -memory * wander_rad_ + rad_from_deg(errors_.compass_wander_deg) * std::sqrt(2 * memory) * random_.normal();
    return wander_rad_ + rad_from_deg(errors_.compass_soft_iron_deg) * std::sin(2 * (heading_rad - soft_iron_at_rad_));
  }

 private:
  const ErrorSpec& errors_;
  Random& random_;
  double wander_rad_, soft_iron_at_rad_;
};

}  // namespace

std::string vehicle_dbc(const Scene& scene) { return vehicle_dbc(steps_of(scene)); }

std::uint64_t write_can_log(const Scene& scene, const CarMotion& motion, double duration_s, Random random,
                            OutputFile& file) {
  const ErrorSpec& errors = scene.errors;
  WheelScales scales;
  for (double& scale : scales) scale = errors.wheel_speed_scale * (1 + errors.wheel_radius_spread * random.normal());
  std::uint64_t frame_count = 0;
  double last_s = 0;
  const auto send = [&](double time_s, const std::string& frame) {
    const double delay_s = 1e-3 * (errors.can_latency_ms + std::abs(errors.can_jitter_ms * random.normal()));
    last_s = std::max(last_s + kFrame_s, time_s + delay_s);
    file.write(print("(%s) can0 %s\n", stamp(instant(scene, last_s)).c_str(), frame.c_str()));
    ++frame_count;
  };
  for (unsigned tick = 0; tick * kTick_s + kWheelsSent_s < duration_s; ++tick) {
    const double steering_s = tick * kTick_s + kSteeringSent_s, wheels_s = tick * kTick_s + kWheelsSent_s;
    send(steering_s, steering_frame(scene, motion.at(steering_s), tick));
    if (tick % 2 == 0) send(wheels_s, wheel_frame(scene, motion.at(wheels_s), scales));
  }
  return frame_count;
}

std::uint64_t write_imu_log(const Scene& scene, const CarMotion& motion, double duration_s, Random random,
                            OutputFile& file) {
  const ErrorSpec& errors = scene.errors;
  CompassError compass(errors, random);
  const Eigen::Vector3d bias_radps(0, 0, rad_from_deg(errors.gyro_bias_degps));
  std::uint64_t tick = 0;
  for (; static_cast<double>(tick) * kTick_s < duration_s; ++tick) {
    const double time_s = static_cast<double>(tick) * kTick_s;
    const CarState car = motion.at(time_s);
    const auto noise = [&](double sigma) {
      const double x = random.normal(), y = random.normal(), z = random.normal();
      return Eigen::Vector3d(sigma * x, sigma * y, sigma * z);
    };
    using Axis = Eigen::AngleAxisd;
    const Eigen::Quaterniond tilt =
        Axis(car.pitch_rad, Eigen::Vector3d::UnitY()) * Axis(car.roll_rad, Eigen::Vector3d::UnitX());
    const double heading_rad = car.pose.theta_rad + compass.next_rad(car.pose.theta_rad);
    const Eigen::Quaterniond q = Axis(heading_rad, Eigen::Vector3d::UnitZ()) * tilt;
    const Eigen::Vector3d level_mps2(car.acceleration_mps2, car.side_acceleration_mps2, kGravity_mps2 + car.z_mps2);
    const Eigen::Vector3d force_mps2 = tilt.inverse() * level_mps2 + noise(errors.acceleration_noise_mps2);
    // Yaw, pitch and roll turn about the vertical, the pitched left and the body's own axis ahead.
    const Eigen::Vector3d rate_radps =
        tilt.inverse() * Eigen::Vector3d(0, 0, car.yaw_rate_radps) +
        Axis(-car.roll_rad, Eigen::Vector3d::UnitX()) * Eigen::Vector3d(0, car.pitch_radps, 0) +
        Eigen::Vector3d(car.roll_radps, 0, 0) + bias_radps + noise(errors.gyro_noise_radps);
    const std::string message = xsens_message(tick, {q, force_mps2, rate_radps});
    file.write(print("(%s) %s\n", stamp(instant(scene, time_s)).c_str(), message.c_str()));
  }
  return tick;
}

}  // namespace roadvec
