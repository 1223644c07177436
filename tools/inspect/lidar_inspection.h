#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/sensor/lidar.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/hdl64_status.h"
#include "drivers/velodyne/packet_clock.h"
#include "drivers/velodyne/sensor_clock.h"
#include "tools/inspect/lidar_statistics.h"
#include "tools/inspect/stream_stats.h"
#include "tools/inspect/survey.h"

namespace roadvec {

struct LidarInspectionOptions {
  std::string pcap, calibration, model, source;  ///< all but pcap may be empty
  int port = kDataPort;                          ///< 0: any
  std::FILE* points = nullptr;                   ///< where the decoded points go as CSV
  bool progress = false;                         ///< tell stderr how far
  bool statistics = false;                       ///< gather LidarStatistics too
};

/// One kind of datagram in the capture: who sends what length to which port.
struct Traffic {
  std::uint32_t source_ipv4 = 0;
  int port = 0;
  std::size_t length = 0;
  friend auto operator<=>(const Traffic&, const Traffic&) = default;
};

struct LidarInspection {
  std::string path;
  std::map<Traffic, std::uint64_t> traffic;
  std::uint64_t other_frame_count = 0;
  Survey survey;
  std::optional<LidarModel> seen_model;
  std::string model;        ///< what was decoded as; empty: nothing was, see not_decoded
  std::string not_decoded;  ///< why there are no points
  LidarCounts counts;
  StreamStats stream;  ///< of the data packets, by arrival
  PacketClockState stamps;
  SensorClockReport gps;
  std::uint64_t other_product_id_count = 0;
  std::optional<Hdl64Status> status;  ///< of an HDL-64E that was decoded
  // revolutions
  std::size_t sweeps = 0, complete_sweeps = 0;
  std::uint64_t returns = 0;
  std::size_t least_returns = 0, median_returns = 0, most_returns = 0;  ///< of complete revolutions
  double median_rate_hz = 0;                                            ///< of complete revolutions
  std::optional<LidarStatistics> statistics;                            ///< if asked for, and decoded
  std::vector<Return> picture;                                          ///< of the first complete revolution
  std::vector<std::string> warnings;
  std::string damage;  ///< why the recording could not be read to its end
};

[[nodiscard]] Expected<LidarInspection> inspect_lidar(const LidarInspectionOptions& options);
void print_text(const LidarInspection& inspection, std::FILE* out);
[[nodiscard]] nlohmann::ordered_json json_of(const LidarInspection& inspection);

}  // namespace roadvec
