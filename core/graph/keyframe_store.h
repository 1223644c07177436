#pragma once

#include "core/base/time.h"
#include "core/geometry/pose2.h"
#include "core/map/packed_lines.h"

namespace roadvec {

/// What is kept of a keyframe: everything but its pose, which is the graph's.
struct KeptKeyframe {
  SensorTime time;
  Pose2 T_odom_vehicle;
  PackedLines lvm, structure;
};

}  // namespace roadvec
