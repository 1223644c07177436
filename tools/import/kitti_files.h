#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/base/time.h"

namespace roadvec {

/// One echo of a scan file, in the `lidar` frame; as in the file.
struct KittiPoint {
  float x_m = 0, y_m = 0, z_m = 0;
  float reflectance = 0;  ///< 0..1
};

/// What the OXTS box says at one instant, in its own axes: x ahead, y left, z up. [Geiger2013]
struct OxtsSample {
  SensorTime time;
  double latitude_deg = 0, longitude_deg = 0, height_m = 0;
  double roll_rad = 0, pitch_rad = 0, yaw_rad = 0;  ///< R = Rz Ry Rx, into East-North-Up
  double north_mps = 0, east_mps = 0;
  double forward_mps = 0;
  double leftward_mps = 0;  ///< the file has it with the other sign than its description says
  Eigen::Vector3d acceleration_mps2 = Eigen::Vector3d::Zero(), rate_radps = Eigen::Vector3d::Zero();
};

// The files of a drive of KITTI's raw data. All take any bytes; errors say what is wrong, not which file.

/// "2011-09-26 13:04:32.349659964", as if it were UTC: the data do not say which hour they mean, and only differences
/// matter.
[[nodiscard]] Expected<SensorTime> parse_kitti_time(std::string_view line);
/// One row of oxts/data; its time stands in another file.
[[nodiscard]] Expected<OxtsSample> parse_oxts(std::string_view line);
/// The R and T of calib_imu_to_velo.txt: T_lidar_imu. R is a rotation to 1e-3, and made exact.
[[nodiscard]] Expected<Eigen::Isometry3d> parse_rigid(std::string_view text);
/// A scan: four floats a point. Points at the origin, which end every scan, are no echoes.
[[nodiscard]] Expected<std::vector<KittiPoint>> parse_scan(std::span<const std::uint8_t> bytes);

}  // namespace roadvec
