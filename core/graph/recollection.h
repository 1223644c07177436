#pragma once

#include <vector>

#include "core/geometry/pose2.h"
#include "core/graph/keyframe_store.h"
#include "core/graph/pose_graph.h"

namespace roadvec {

/// Where a drive may begin in an earlier map, and how surely.
struct StartGuess {
  Pose2 T_map_odom;
  PoseCovariance covariance = PoseCovariance::Identity();  ///< in the vehicle's own axes: ahead, to the left, heading
};

/// What is kept of an earlier drive, and where the vehicle may now be in it.
struct Recollection {
  PoseGraph graph;
  std::vector<KeptKeyframe> keyframes;  ///< one per pose of the graph; not empty
  std::vector<StartGuess> guesses;      ///< in the order in which they are tried; not empty
};

}  // namespace roadvec
