#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "tools/import/kitti_files.h"

namespace roadvec {

/// One scan of a drive, still on disk.
struct KittiFrame {
  std::string name;  ///< "0000000153"
  std::filesystem::path path;
  SensorTime start, end;
};

/// Scans or OXTS rows, one behind the other, that could not be used, and why.
struct LeftOut {
  std::string first, last;
  std::size_t count = 0;
  std::string reason;
};
/// Adds one more: to the last run if the reason is the same.
void leave_out(std::vector<LeftOut>& left_out, const std::string& name, const std::string& reason);

/// A drive of KITTI's raw data: <date>/<date>_drive_<number>_sync, its scans still on disk.
struct KittiDrive {
  std::vector<KittiFrame> frames;  ///< by growing time
  std::vector<OxtsSample> oxts;    ///< by growing time, at least two
  Eigen::Isometry3d T_lidar_imu = Eigen::Isometry3d::Identity();
  std::vector<LeftOut> left_out;
};

/// Errors: a folder or file that every drive has is missing or unreadable, or nothing usable is in it. Frames without a
/// scan, and rows that cannot be read, are left out.
[[nodiscard]] Expected<KittiDrive> open_kitti_drive(const std::filesystem::path& folder);

/// The points of one scan. Error: it is damaged or gone.
[[nodiscard]] Expected<std::vector<KittiPoint>> load_scan(const KittiFrame& frame);

}  // namespace roadvec
