#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"
#include "tools/simulate/scene_file.h"
#include "tools/simulate/simulate.h"

namespace roadvec {

/// A straight road to the east, kerbs at y = +-4, walls at y = +-9: every surface is known without the simulator's own
/// geometry.
inline constexpr double kKerb_m = 4, kKerbHeight_m = 0.12, kWall_m = 9, kWallHeight_m = 5, kRoad_m = 120;
[[nodiscard]] inline Scene plain_scene() {
  auto scene = parse_scene(R"(
[road]
waypoints = [[0, 0], [120, 0]]
width_m = 8
crown_percent = 0
kerb_height_m = 0.12
kerb_round_m = 0
sidewalk_percent = 0
sidewalk_m = 20
[[road.wall]]
side = "left"
setback_m = 5
height_m = 5
[[road.wall]]
side = "right"
setback_m = 5
height_m = 5
[car]
lane_m = -1.75
start_m = 50
distance_m = 40
wait_s = 0.0
speed_mps = 12
acceleration_mps2 = 5
[lidar]
pitch_deg = 0.7
yaw_deg = -1.5
roll_deg = 0.4
[roughness_m]
road = 0
sidewalk = 0
[errors]
laser_bias_m = 0.0
laser_elevation_deg = 0.0
)",
                           "plain.toml");
  if (!scene) throw std::runtime_error(scene.error().message);
  return *scene;
}

struct TruePose {
  double time_s;
  Eigen::Isometry3d T_map_vehicle;
};

[[nodiscard]] inline std::vector<TruePose> read_tum(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<TruePose> poses;
  double t, x, y, z, qx, qy, qz, qw;
  while (file >> t >> x >> y >> z >> qx >> qy >> qz >> qw) {
    poses.push_back({t, Eigen::Translation3d(x, y, z) * Eigen::Quaterniond(qw, qx, qy, qz)});
  }
  return poses;
}

}  // namespace roadvec
