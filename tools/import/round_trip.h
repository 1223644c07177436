#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "core/base/error.h"
#include "tools/import/firings.h"

namespace roadvec {

/// How far the points that a drive decodes to lie from those that it was made from.
struct RoundTrip {
  std::uint64_t point_count = 0;
  std::uint64_t missing_count = 0;  ///< echoes that do not come out
  double median_m = 0, quantile95_m = 0, max_m = 0;
};

/// Decodes a capture as every reader of the drive would, and compares. `next_revolution` gives the firings that went
/// in, one revolution after the other, and none at the end.
[[nodiscard]] Expected<RoundTrip> check_round_trip(const std::filesystem::path& pcap,
                                                   const std::filesystem::path& calibration,
                                                   const std::function<std::vector<Firing>()>& next_revolution);

}  // namespace roadvec
