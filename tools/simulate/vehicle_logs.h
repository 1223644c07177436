#pragma once

#include <cstdint>
#include <string_view>

#include "tools/recording/output_file.h"
#include "tools/simulate/car_motion.h"
#include "tools/simulate/random.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// The car's messages: steering angle (Motorola, 100 Hz) and wheel speeds (Intel, 50 Hz).
[[nodiscard]] std::string vehicle_dbc(const Scene& scene);

/// What the bus carries during the first duration_s of the drive, as candump -L writes it: each frame later than what
/// it tells, by latency and jitter, but none before one sent earlier. Returns how many frames.
std::uint64_t write_can_log(const Scene& scene, const CarMotion& motion, double duration_s, Random random,
                            OutputFile& file);

/// What an Xsens IMU over the rear axle sends, 100 MTData2 messages a second: rate of turn, specific force,
/// orientation.
std::uint64_t write_imu_log(const Scene& scene, const CarMotion& motion, double duration_s, Random random,
                            OutputFile& file);

}  // namespace roadvec
