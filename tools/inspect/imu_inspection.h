#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "tools/inspect/stream_stats.h"

namespace roadvec {

/// What an IMU's recording holds.
struct ImuInspection {
  std::string path, protocol;
  std::uint64_t byte_count = 0, bad_checksum_count = 0, skipped_byte_count = 0, lost_message_count = 0;
  std::uint64_t bad_line_count = 0;
  StreamStats stream;  ///< of the samples
  std::uint64_t rate_count = 0, acceleration_count = 0, orientation_count = 0;
  double mean_acceleration_mps2 = 0;  ///< its length: 9.8 says that units and axes are right
  double mean_rate_z_radps = 0;
  std::vector<std::string> notes;  ///< what else the device says of itself
};

/// `protocol`: "xsens", "ncom", or empty: the one of which more is understood.
[[nodiscard]] Expected<ImuInspection> inspect_imu(const std::string& path, const std::string& protocol);
void print_text(const ImuInspection& inspection, std::FILE* out);
[[nodiscard]] nlohmann::ordered_json json_of(const ImuInspection& inspection);

}  // namespace roadvec
