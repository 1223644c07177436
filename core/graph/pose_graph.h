#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/geometry/pose2.h"

namespace roadvec {

/// A measured relative pose T_from_to with its information in the frame of `from`; singular where nothing was observed.
struct PoseEdge {
  std::size_t from = 0, to = 0;
  Pose2 T_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

/// A matching constraint between a keyframe and an earlier one. Never forgotten: one that the rest of the graph
/// contradicts is switched off, not erased.
struct LoopEdge {
  PoseEdge edge;
  bool active = true;
};

/// Keyframe poses and what constrains them [He2018, III-D]. Keyframes are 0, 1, 2, ... without gaps.
struct PoseGraph {
  std::vector<Pose2> poses_map;    ///< T_map_vehicle
  std::vector<PoseEdge> odometry;  ///< odometry[k]: from keyframe k to k + 1
  std::vector<LoopEdge> loops;
  std::vector<double> travelled_m;  ///< per keyframe, since the first
};

}  // namespace roadvec
