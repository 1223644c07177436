#pragma once

#include "core/base/time.h"
#include "core/geometry/pose2.h"

namespace roadvec {

/// Where the vehicle is: mapping thread -> server, through a Latest<PoseReport>, at least 20 times a second.
struct PoseReport {
  SensorTime time;
  Pose2 T_odom_vehicle;                                ///< the server, which follows the map, knows T_map_odom
  PoseCovariance covariance = PoseCovariance::Zero();  ///< of T_odom_vehicle, in odom
  double speed_mps = 0, yaw_rate_radps = 0;
};

}  // namespace roadvec
