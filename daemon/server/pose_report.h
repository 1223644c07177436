#pragma once

#include <cstdint>

#include "core/base/time.h"
#include "core/geometry/pose2.h"

namespace roadvec {

/// Where the vehicle is: mapping thread -> server, through a Latest<PoseReport>, at least 20 times a second.
struct PoseReport {
  SensorTime time;
  std::uint64_t epoch = 0;  ///< of T_map_odom: the one that MapPublisher::head() gave with it
  Pose2 T_map_odom, T_odom_vehicle;
  PoseCovariance covariance = PoseCovariance::Zero();  ///< of T_odom_vehicle, in odom
  double speed_mps = 0, yaw_rate_radps = 0;
};

}  // namespace roadvec
