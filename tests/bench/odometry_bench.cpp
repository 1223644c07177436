// Step 0: one sweep's worth of samples, 100 Hz steering and IMU, 50 Hz wheels.

#include "core/odometry/odometry.h"

#include <benchmark/benchmark.h>

#include <vector>

namespace roadvec {
namespace {

void odometry(benchmark::State& state) {
  Odometry filter({}, {.wheelbase_m = 2.7, .track_m = 1.5, .steering_ratio = 15});
  std::vector<MotionSample> samples;
  for (int i = 0; i < 10; ++i) {
    samples.push_back({{}, SteeringAngle{0.1}});
    samples.push_back(
        {{}, ImuSample{.rate_z_radps = 0.05, .heading_rad = 0.2, .has_rate = true, .has_orientation = true}});
    if (i % 2 == 0) samples.push_back({{}, WheelSpeed{10, 10, 10, 10}});
  }
  SensorTime now{0};
  for (auto _ : state) {
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i].time = now + static_cast<std::int64_t>(i) * 4'000'000;
    benchmark::DoNotOptimize(filter.integrate(samples, now, now + 100'000'000));
    filter.correct(filter.pose(), Eigen::Matrix3d::Identity() * 1e4);
    now = now + 100'000'000;
  }
}
BENCHMARK(odometry)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace roadvec
