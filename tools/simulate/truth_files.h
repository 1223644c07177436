#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tools/recording/output_file.h"
#include "tools/simulate/car_motion.h"
#include "tools/simulate/lidar_scanner.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {

/// Where the car truly was, 100 times a second: t x y z qx qy qz qw in the map frame (east, north, up from the start).
void write_poses_tum(const Scene& scene, const CarMotion& motion, double duration_s, OutputFile& file);
/// The same at the end of each revolution: where the azimuth that the packets carry begins anew.
void write_sweeps_tum(const Scene& scene, const CarMotion& motion, double duration_s, OutputFile& file);

/// The world's boundaries where they meet the ground, WGS 84 with the map frame's origin at the anchor. Each line says
/// its kind, its height and from how near the LiDAR has seen it: lines are cut where that changes. Returns how many
/// lines.
std::uint64_t write_boundaries_geojson(const Scene& scene, const BuiltWorld& built, const Pose2& start,
                                       std::span<const SeenFrom> faces_seen, OutputFile& file);

}  // namespace roadvec
