#pragma once

#include <filesystem>
#include <string>

#include "core/base/error.h"
#include "core/geometry/anchor.h"
#include "tools/recording/output_file.h"

namespace roadvec {

/// How a sensor sits in the vehicle: R = Rz Ry Rx.
struct MountingDegrees {
  double roll_deg = 0, pitch_deg = 0, yaw_deg = 0;
};

/// What drive.toml says of a drive whose files have their usual names: lidar.pcap, db.xml, can.log with the messages of
/// vehicle_dbc() in vehicle.dbc, and imu.log with an Xsens' messages.
struct DriveDescription {
  std::string source;  ///< any text
  std::string lidar_model;
  bool has_calibration = true;
  double lidar_x_m = 0, lidar_y_m = 0, lidar_z_m = 0;
  MountingDegrees lidar, imu;
  double wheelbase_m = 0, track_m = 0, steering_ratio = 0;
  Anchor anchor;
};
[[nodiscard]] std::string drive_toml(const DriveDescription& drive);

/// Makes `out` and `out`/truth; `out` must not be there yet, or be empty.
[[nodiscard]] Expected<void> make_drive_folder(const std::filesystem::path& out);

/// Creates the file, lets `fill` write it, closes it.
template <class Fill>
[[nodiscard]] Expected<void> write_file(const std::filesystem::path& path, Fill&& fill) {
  auto file = OutputFile::create(path);
  if (!file) return tl::unexpected(file.error());
  fill(*file);
  return file->close();
}

}  // namespace roadvec
