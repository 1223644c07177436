#pragma once

#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/pipeline/front_end.h"
#include "daemon/config/settings.h"
#include "daemon/stages/motion_input.h"
#include "drivers/velodyne/calibration.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/packet_source.h"
#include "drivers/velodyne/sweep_decoder.h"

namespace roadvec {

/// A drive's files or the car's interfaces.
enum class InputKind : std::uint8_t { live, recorded };

struct LidarInput {
  LidarModel model{};
  Calibration calibration;
  SweepDecoderOptions options;
  std::unique_ptr<PacketSource> source;
};
/// Opens what [lidar] names. `counters` outlives the source.
[[nodiscard]] Expected<LidarInput> open_lidar(const LidarSettings& settings, InputKind kind, LidarCounters& counters);

/// The motion inputs of [vehicle] and [imu]. Lines of the DBC file that cannot be read are logged, the rest is used.
[[nodiscard]] Expected<std::vector<std::unique_ptr<MotionInput>>> open_vehicle(const Settings& settings,
                                                                               InputKind kind);

[[nodiscard]] FrontEndSetup front_end_setup(const Settings& settings, LidarModel model);

}  // namespace roadvec
