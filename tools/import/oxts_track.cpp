#include "tools/import/oxts_track.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/angle.h"
#include "tools/recording/xsens_message.h"

namespace roadvec {
namespace {

constexpr std::int64_t kTick_ns = 10'000'000;
/// When in a tick the two messages go out; an ECU is in step with nothing else.
constexpr std::int64_t kSteeringSent_ns = 1'300'000, kWheelsSent_ns = 3'700'000;
/// Slower, and the steering angle cannot be told from the yaw rate.
constexpr double kSlowest_mps = 0.5;
/// Of a step between rows, how far the attitude is drawn out before the first and after the last.
constexpr double kMostBeyond = 1.5;

double between(double a, double b, double share) { return a + share * (b - a); }
double angle_between(double a_rad, double b_rad, double share) {
  return wrap_rad(a_rad + share * wrap_rad(b_rad - a_rad));
}

}  // namespace

/// `most_share`: 1 holds the last row, more draws its step out.
OxtsSample OxtsTrack::row_at(SensorTime time, double most_share) const {
  const auto later = std::upper_bound(samples_.begin() + 1, samples_.end() - 1, time,
                                      [](SensorTime t, const OxtsSample& sample) { return t < sample.time; });
  const OxtsSample& b = *later;
  const OxtsSample& a = *(later - 1);
  const double share =
      std::clamp(seconds_between(a.time, time) / seconds_between(a.time, b.time), 1 - most_share, most_share);
  OxtsSample row = a;
  row.time = time;
  row.latitude_deg = between(a.latitude_deg, b.latitude_deg, share);
  row.longitude_deg = between(a.longitude_deg, b.longitude_deg, share);
  row.height_m = between(a.height_m, b.height_m, share);
  row.roll_rad = angle_between(a.roll_rad, b.roll_rad, share);
  row.pitch_rad = angle_between(a.pitch_rad, b.pitch_rad, share);
  row.yaw_rad = angle_between(a.yaw_rad, b.yaw_rad, share);
  row.north_mps = between(a.north_mps, b.north_mps, share);
  row.east_mps = between(a.east_mps, b.east_mps, share);
  row.forward_mps = between(a.forward_mps, b.forward_mps, share);
  row.leftward_mps = between(a.leftward_mps, b.leftward_mps, share);
  row.acceleration_mps2 = a.acceleration_mps2 + share * (b.acceleration_mps2 - a.acceleration_mps2);
  row.rate_radps = a.rate_radps + share * (b.rate_radps - a.rate_radps);
  return row;
}

OxtsSample OxtsTrack::at(SensorTime time) const {
  const OxtsSample attitude = row_at(time, kMostBeyond);
  OxtsSample sample = row_at(time + kOxtsLag_ns, 1);
  sample.time = time;
  sample.latitude_deg = attitude.latitude_deg;
  sample.longitude_deg = attitude.longitude_deg;
  sample.height_m = attitude.height_m;
  sample.roll_rad = attitude.roll_rad;
  sample.pitch_rad = attitude.pitch_rad;
  sample.yaw_rad = attitude.yaw_rad;
  return sample;
}

AxleMotion axle_motion(const OxtsSample& sample, double imu_left_m) {
  const double yaw_rate_radps = sample.rate_radps.z();
  return {sample.forward_mps + yaw_rate_radps * imu_left_m, yaw_rate_radps};
}

std::uint64_t write_can_log(const OxtsTrack& track, const KittiCar& car, double imu_left_m, SensorTime from,
                            SensorTime to, OutputFile& file) {
  constexpr CarMessageSteps kSteps;
  std::uint64_t frame_count = 0;
  double wheel_deg = 0;
  const auto send = [&](SensorTime time, const std::string& frame) {
    file.write(print("(%s) can0 %s\n", stamp(time).c_str(), frame.c_str()));
    ++frame_count;
  };
  unsigned tick = 0;
  for (SensorTime time = from; time < to; time = time + kTick_ns, ++tick) {
    const AxleMotion steered = axle_motion(track.at(time + kSteeringSent_ns), imu_left_m);
    if (std::abs(steered.speed_mps) >= kSlowest_mps) {
      wheel_deg =
          car.steering_ratio * deg_from_rad(std::atan(car.wheelbase_m * steered.yaw_rate_radps / steered.speed_mps));
    }
    send(time + kSteeringSent_ns, steering_frame(kSteps, wheel_deg, tick));
    if (tick % 2 != 0) continue;
    const AxleMotion rolled = axle_motion(track.at(time + kWheelsSent_ns), imu_left_m);
    send(time + kWheelsSent_ns,
         wheel_frame(kSteps, wheel_speeds_mps(car.wheelbase_m, car.track_m, rolled.speed_mps, rolled.yaw_rate_radps)));
  }
  return frame_count;
}

std::uint64_t write_imu_log(const OxtsTrack& track, SensorTime from, SensorTime to, OutputFile& file) {
  std::uint64_t tick = 0;
  for (SensorTime time = from; time < to; time = time + kTick_ns, ++tick) {
    const OxtsSample sample = track.at(time);
    const Eigen::Quaterniond q = Eigen::AngleAxisd(sample.yaw_rad, Eigen::Vector3d::UnitZ()) *
                                 Eigen::AngleAxisd(sample.pitch_rad, Eigen::Vector3d::UnitY()) *
                                 Eigen::AngleAxisd(sample.roll_rad, Eigen::Vector3d::UnitX());
    const std::string message = xsens_message(tick, {q, sample.acceleration_mps2, sample.rate_radps});
    file.write(print("(%s) %s\n", stamp(time).c_str(), message.c_str()));
  }
  return tick;
}

}  // namespace roadvec
