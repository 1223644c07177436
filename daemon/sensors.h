#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/pipeline/front_end.h"
#include "daemon/config/settings.h"
#include "daemon/service.h"
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
/// Opens what [lidar] names; sockets that were handed over are taken for their ports. `counters` outlives the source.
[[nodiscard]] Expected<LidarInput> open_lidar(const LidarSettings& settings, InputKind kind, LidarCounters& counters,
                                              const PassedSockets& sockets = {});

struct VehicleInput {
  std::vector<std::unique_ptr<MotionInput>> inputs;
  std::string imu_device;  ///< what it said of itself, if it was set up; else empty
};
/// The motion inputs of [vehicle] and [imu]. Lines of the DBC file that cannot be read are logged, the rest is used.
[[nodiscard]] Expected<VehicleInput> open_vehicle(const Settings& settings, InputKind kind,
                                                  const PassedSockets& sockets = {});

[[nodiscard]] FrontEndSetup front_end_setup(const Settings& settings, LidarModel model);

}  // namespace roadvec
