#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "tools/import/head_fit.h"
#include "tools/import/kitti_drive.h"
#include "tools/import/placement.h"
#include "tools/import/round_trip.h"

namespace roadvec {

/// `step`: what is being done; `share` of it that is done.
using ImportProgress = std::function<void(std::string_view step, double share)>;

struct ImportReport {
  std::size_t frame_count = 0;  ///< imported
  std::vector<LeftOut> left_out;
  double duration_s = 0, distance_m = 0;
  std::uint64_t point_count = 0, lost_point_count = 0, off_point_count = 0;
  std::uint64_t packet_count = 0, can_frame_count = 0, imu_sample_count = 0, lidar_bytes = 0;
  double off_the_line_m = 0, cell_error = 0, rotation_agreement = 0;  ///< of the fitted head
  RoundTrip round_trip;
  double residual_m = 0, matched_share = 0;  ///< of the registration
  MountingDegrees lidar;
  Anchor anchor;

  /// Decoding gives the points back: half of them to a millimetre, 95 % to two, none missing.
  [[nodiscard]] bool faithful() const {
    return round_trip.median_m < 1e-3 && round_trip.quantile95_m < 2e-3 && round_trip.missing_count == 0;
  }
};

/// Turns a drive of KITTI's raw data [Geiger2013] into a drive folder `out`, which must not be there yet or be empty:
/// HDL-64E S2 packets and a db.xml from the scans, CAN and Xsens messages from the OXTS rows, the path by registering
/// the scans. Reads every scan twice. The same drive gives the same bytes.
[[nodiscard]] Expected<ImportReport> import_kitti_raw(const std::filesystem::path& folder,
                                                      const std::filesystem::path& out, const ImportProgress& progress);

}  // namespace roadvec
