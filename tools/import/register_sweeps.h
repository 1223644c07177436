#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <span>
#include <vector>

#include "core/base/time.h"
#include "tools/import/firings.h"

namespace roadvec {

/// What registration needs of a revolution.
struct SweepPoints {
  struct Point {
    Eigen::Vector3f lidar_m;
    float share = 0;  ///< when, of the revolution, from -0.5 to 0.5
  };
  SensorTime start, end;
  std::vector<Point> points;

  [[nodiscard]] SensorTime middle() const { return start + (end - start) / 2; }
};

/// A tenth of the points, some 10,000: all lasers of every tenth firing, between 3 and 60 m.
[[nodiscard]] SweepPoints thinned(const Firings& revolution, SensorTime start, SensorTime end);

struct Registration {
  std::vector<Eigen::Isometry3d> T_first_lidar;  ///< where the LiDAR was in the middle of each sweep
  double residual_m = 0;     ///< median distance of the points from the surfaces of the sweeps around theirs
  double matched_share = 0;  ///< of the points: lie on such a surface
};

/// Where the LiDAR was, by laying each sweep onto the surfaces that the sweeps around it have seen, point to plane;
/// first against those before it, then, again and again, against those on both sides, so that no error is carried on
/// that a later sweep can see. Every sweep is straightened by the motion from the one before to the one behind.
/// `motion`: what another sensor says of the LiDAR's motion between two instants; the first guess.
[[nodiscard]] Registration register_sweeps(
    std::span<const SweepPoints> sweeps, const std::function<Eigen::Isometry3d(SensorTime from, SensorTime to)>& motion,
    const std::function<void(double share)>& progress);

}  // namespace roadvec
