#include "tools/simulate/vehicle_logs.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>

#include "core/base/angle.h"

namespace roadvec {
namespace {

constexpr double kTick_s = 0.01;
/// When in a tick the two messages go out; an ECU is in step with nothing else.
constexpr double kSteeringSent_s = 0.0013, kWheelsSent_s = 0.0037;
constexpr double kGravity_mps2 = 9.81;

SensorTime instant(const Scene& scene, double time_s) { return {scene.start_ns + std::llround(time_s * 1e6) * 1000}; }

std::string steering_frame(const Scene& scene, const CarState& car, unsigned counter) {
  const double wheel_deg = deg_from_rad(car.steering_rad) * scene.car.steering_ratio + scene.errors.steering_offset_deg;
  const long raw = std::clamp(std::lround(wheel_deg / scene.errors.steering_step_deg), -32768L, 32767L);
  return print("0C2#%04X00%02X", static_cast<unsigned>(raw) & 0xFFFF, counter & 0xF);
}

/// Each wheel goes as fast as its own place on the car: the outer ones farther, the front ones along the steered
/// circle.
std::string wheel_frame(const Scene& scene, const CarState& car) {
  const double half_m = scene.car.track_m / 2, ahead_m = scene.car.wheelbase_m;
  const std::array<Eigen::Vector2d, 4> wheels_m{{{ahead_m, half_m}, {ahead_m, -half_m}, {0, half_m}, {0, -half_m}}};
  std::string frame = "1A0#";
  for (const Eigen::Vector2d& wheel_m : wheels_m) {
    const double w = car.yaw_rate_radps;
    const double speed_mps = std::hypot(car.speed_mps - w * wheel_m.y(), w * wheel_m.x());
    const double kmh = 3.6 * speed_mps * scene.errors.wheel_speed_scale;
    const auto raw =
        static_cast<unsigned>(std::clamp(std::lround(kmh / scene.errors.wheel_speed_step_kmph), 0L, 65535L));
    frame += print("%02X%02X", raw & 0xFF, raw >> 8);
  }
  return frame;
}

/// One MTData2 message being put together, big endian throughout.
class XsensMessage {
 public:
  void datum(unsigned id, unsigned size) { put(id << 8 | size, 3); }
  void put(std::uint32_t value, int count) {
    for (int i = count; i-- > 0;) data_.push_back(static_cast<std::uint8_t>(value >> 8 * i & 0xFF));
  }
  void floats(unsigned id, std::initializer_list<double> values) {
    datum(id, static_cast<unsigned>(4 * values.size()));
    for (const double value : values) put(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
  }
  [[nodiscard]] std::string hex() const {
    std::string text = print("faff36%02x", static_cast<unsigned>(data_.size()));
    unsigned sum = 0xFF + 0x36 + static_cast<unsigned>(data_.size());
    for (const std::uint8_t byte : data_) {
      text += print("%02x", byte);
      sum += byte;
    }
    return text + print("%02x", -sum & 0xFF);
  }

 private:
  std::vector<std::uint8_t> data_;
};

}  // namespace

std::string stamp(SensorTime time) {
  return print("%lld.%06lld", static_cast<long long>(time.ns / 1'000'000'000),
               static_cast<long long>(time.ns % 1'000'000'000 / 1000));
}

std::string vehicle_dbc(const Scene& scene) {
  const std::string steering = print("%g", scene.errors.steering_step_deg);
  std::string text =
      "VERSION \"1\"\n\nNS_ :\n\nBS_:\n\nBU_: EPS ABS\n\n"
      "BO_ 194 SteeringSensor: 4 EPS\n"
      " SG_ SteeringWheelAngle : 7|16@0- (" +
      steering +
      ",0) [-800|800] \"deg\" ABS\n"
      " SG_ SteeringCounter : 24|4@1+ (1,0) [0|15] \"\" ABS\n\n"
      "BO_ 416 WheelSpeeds: 8 ABS\n";
  int bit = 0;
  for (const char* wheel : {"FL", "FR", "RL", "RR"}) {
    text += print(" SG_ WheelSpeed%s : %d|16@1+ (%g,0) [0|%g] \"km/h\" EPS\n", wheel, bit,
                  scene.errors.wheel_speed_step_kmph, 65535 * scene.errors.wheel_speed_step_kmph);
    bit += 16;
  }
  return text +
         "\nCM_ SG_ 194 SteeringWheelAngle \"Left positive.\";\n"
         "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 10000;\n"
         "BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n"
         "BA_ \"GenMsgCycleTime\" BO_ 194 10;\n"
         "BA_ \"GenMsgCycleTime\" BO_ 416 20;\n";
}

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
