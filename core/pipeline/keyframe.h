#pragma once

#include <cstdint>

#include "core/base/time.h"
#include "core/geometry/line_set.h"
#include "core/geometry/pose2.h"

namespace roadvec {

struct KeyframeConfig {
  double spacing_m = 2.0;     ///< a window of 80 m is seen forty times over (choice)
  double spacing_rad = 0.35;  ///< 20 deg: a turn on the spot shows other streets
  double range_m = 30.0;      ///< beyond, rings lie too far apart for a kerb [He2018, IV-A: 80 m x 30 m]
};
template <class Visitor>
void visit_fields(KeyframeConfig& c, Visitor&& field) {
  field("keyframe.spacing_m", c.spacing_m, 0.2, 50.0, "way between two keyframes");
  field("keyframe.spacing_rad", c.spacing_rad, 0.05, 3.2, "or turn between two keyframes");
  field("keyframe.range_m", c.range_m, 5.0, 100.0, "boundaries farther from the vehicle wait for a nearer keyframe");
}

/// What the front end hands to the back end each time the vehicle has moved far enough: one local vector map and how
/// the vehicle came there. Slots of a ring: the line sets are reserved once and refilled in place.
struct Keyframe {
  std::uint64_t index = 0;  ///< 0, 1, 2, ... without gaps
  SensorTime time;
  std::int64_t received_ns = 0;  ///< Sweep::received_ns of its sweep
  Pose2 T_odom_vehicle;
  PoseCovariance covariance_since_previous =
      PoseCovariance::Zero();  ///< of T_previous_this, in the previous keyframe's frame
  double travelled_m = 0;      ///< since the first keyframe
  LineSet lvm;                 ///< simplified LVM of the road's boundaries, vehicle frame
  LineSet structure;           ///< simplified lines of tall structure, vehicle frame: steers matching, is not mapped
};

}  // namespace roadvec
