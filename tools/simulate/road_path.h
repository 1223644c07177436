#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/base/error.h"
#include "tools/simulate/scene.h"

namespace roadvec {

struct PathPoint {
  Eigen::Vector2d position_m;
  double heading_rad = 0;
  double curvature_1pm = 0;  ///< left positive
};

/// The place on a line that is nearest to a point.
struct PathPlace {
  double station_m = 0;  ///< below 0 or beyond the length off an open line's ends
  double left_m = 0;     ///< of the point beside the line there
};

/// A line on the ground, such as a road's centre line: straight pieces joined by arcs, measured by station (metres
/// along it).
///
/// Station 0 is the first waypoint; on a closed road, the end of the first waypoint's arc. Beyond an open road's ends
/// the line goes on straight; a closed one begins anew.
class RoadPath {
 public:
  [[nodiscard]] static Expected<RoadPath> create(const std::vector<Waypoint>& waypoints, bool closed);

  [[nodiscard]] double length_m() const { return length_m_; }
  [[nodiscard]] bool closed() const { return closed_; }
  [[nodiscard]] PathPoint at(double station_m) const;

  /// The point `left_m` beside the line. Inside a curve tighter than left_m the parallels of both legs end where they
  /// meet, so that a parallel never runs backwards.
  [[nodiscard]] Eigen::Vector2d beside(double station_m, double left_m) const;

  /// Nearest place; the line's ends are prolonged straight on.
  [[nodiscard]] PathPlace nearest(const Eigen::Vector2d& point_m) const;
  /// Where something bends: stations between which the line is straight or bends evenly.
  [[nodiscard]] std::vector<double> joints_m() const;

 private:
  struct Piece {
    double station_m = 0, length_m = 0;
    PathPoint start;
    double turn_rad = 0;
  };
  RoadPath() = default;
  void append(double length_m, const PathPoint& start);
  [[nodiscard]] double wrapped(double station_m) const;

  std::vector<Piece> pieces_;
  double length_m_ = 0;
  bool closed_ = false;
};

}  // namespace roadvec
