#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "core/geometry/anchor.h"
#include "tools/import/oxts_track.h"
#include "tools/import/register_sweeps.h"
#include "tools/recording/drive_folder.h"
#include "tools/recording/output_file.h"

namespace roadvec {

/// Where the LiDAR sits in the vehicle, by what it saw: upright over the road, and ahead along the way that the rear
/// axle goes. Its height and its place along the car are the car's own.
[[nodiscard]] Eigen::Isometry3d lidar_mounting(std::span<const SweepPoints> sweeps, const Registration& registration,
                                               const KittiCar& car);

/// R = Rz Ry Rx.
[[nodiscard]] MountingDegrees angles_of(const Eigen::Matrix3d& rotation);

/// The vehicle's path in the map frame, whose origin is where the vehicle was at `start`.
struct TruthPath {
  struct Pose {
    SensorTime time;
    Eigen::Isometry3d T_map_vehicle;
  };
  Anchor anchor;
  std::vector<Pose> poses;  ///< in the middle of each sweep

  /// Between poses evenly; before the first and after the last it goes on as it did.
  [[nodiscard]] Eigen::Isometry3d at(SensorTime time) const;
};

/// The registered path as East-North-Up. Position, roll and pitch at `start` are the OXTS box's; the heading is the way
/// that its velocities say the car goes, averaged over the drive: its own heading is a degree off that.
[[nodiscard]] TruthPath place_path(std::span<const SweepPoints> sweeps, const Registration& registration,
                                   const OxtsTrack& track, const Eigen::Isometry3d& T_vehicle_lidar,
                                   const Eigen::Isometry3d& T_vehicle_imu);

/// 100 times a second: t x y z qx qy qz qw.
void write_poses_tum(const TruthPath& path, SensorTime from, SensorTime to, OutputFile& file);

}  // namespace roadvec
