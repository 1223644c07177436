#include "tools/simulate/road_path.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/angle.h"

namespace roadvec {
namespace {

Eigen::Vector2d direction(double heading_rad) { return {std::cos(heading_rad), std::sin(heading_rad)}; }

Eigen::Vector2d left_of(double heading_rad) { return {-std::sin(heading_rad), std::cos(heading_rad)}; }

/// A bend that needs no arc.
constexpr double kSharpest_rad = 0.01;

/// A waypoint with its arc: how far the arc reaches along both legs.
struct Corner {
  double heading_in_rad = 0, turn_rad = 0, radius_m = 0, reach_m = 0;
};

double heading_between(const Waypoint& a, const Waypoint& b) {
  const Eigen::Vector2d leg = b.position_m - a.position_m;
  return std::atan2(leg.y(), leg.x());
}

Corner corner_at(const Waypoint& before, const Waypoint& here, const Waypoint& after) {
  Corner corner;
  corner.heading_in_rad = heading_between(before, here);
  corner.turn_rad = wrap_rad(heading_between(here, after) - corner.heading_in_rad);
  corner.radius_m = here.radius_m;
  corner.reach_m = here.radius_m * std::tan(std::abs(corner.turn_rad) / 2);
  return corner;
}

}  // namespace

void RoadPath::append(double length_m, const PathPoint& start) {
  if (length_m < 1e-9) return;
  pieces_.push_back({length_m_, length_m, start, start.curvature_1pm * length_m});
  length_m_ += length_m;
}

Expected<RoadPath> RoadPath::create(const std::vector<Waypoint>& waypoints, bool closed) {
  const std::size_t count = waypoints.size();
  if (count < (closed ? 3U : 2U)) return fail("waypoints: an open line needs two, a closed one three");
  RoadPath path;
  path.closed_ = closed;
  std::vector<Corner> corners(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!closed && (i == 0 || i + 1 == count)) continue;
    corners[i] = corner_at(waypoints[(i + count - 1) % count], waypoints[i], waypoints[(i + 1) % count]);
    if (corners[i].radius_m > 0 || std::abs(corners[i].turn_rad) < kSharpest_rad) continue;
    return fail("waypoints: the line turns at waypoint " + std::to_string(i) +
                " (counted from 0), which needs a radius above 0 as its third number");
  }
  for (std::size_t i = 0; i < (closed ? count : count - 1); ++i) {
    const std::size_t next = (i + 1) % count;
    const double leg_m = (waypoints[next].position_m - waypoints[i].position_m).norm();
    const double straight_m = leg_m - corners[i].reach_m - corners[next].reach_m;
    if (straight_m < 0 || leg_m < 0.1) {
      return fail("waypoints: the arcs at waypoints " + std::to_string(i) + " and " + std::to_string(next) +
                  " (counted from 0) do not fit on the leg between them; shorten a radius or move a waypoint");
    }
    const double heading_rad = heading_between(waypoints[i], waypoints[next]);
    path.append(straight_m, {waypoints[i].position_m + corners[i].reach_m * direction(heading_rad), heading_rad, 0});
    const Corner& corner = corners[next];
    if (corner.radius_m <= 0 || corner.reach_m <= 0) continue;
    path.append(corner.radius_m * std::abs(corner.turn_rad),
                {waypoints[next].position_m - corner.reach_m * direction(heading_rad), heading_rad,
                 std::copysign(1.0 / corner.radius_m, corner.turn_rad)});
  }
  return path;
}

double RoadPath::wrapped(double station_m) const {
  return closed_ ? station_m - length_m_ * std::floor(station_m / length_m_) : station_m;
}

PathPoint RoadPath::at(double station_m) const {
  const double s = wrapped(station_m);
  const auto after = std::upper_bound(pieces_.begin(), pieces_.end(), s,
                                      [](double value, const Piece& piece) { return value < piece.station_m; });
  const Piece& piece = after == pieces_.begin() ? *after : *(after - 1);
  const double along_m = s - piece.station_m;
  const double bent_m = std::clamp(along_m, 0.0, piece.length_m);
  const double k = piece.start.curvature_1pm;
  PathPoint point{piece.start.position_m, piece.start.heading_rad + k * bent_m, along_m == bent_m ? k : 0};
  if (k == 0) {
    point.position_m += bent_m * direction(point.heading_rad);
  } else {
    point.position_m += (left_of(piece.start.heading_rad) - left_of(point.heading_rad)) / k;
  }
  point.position_m += (along_m - bent_m) * direction(point.heading_rad);
  return point;
}

Eigen::Vector2d RoadPath::beside(double station_m, double left_m) const {
  double s = wrapped(station_m);
  for (const Piece& piece : pieces_) {
    const double k = piece.start.curvature_1pm;
    if (left_m * k <= 1.0) continue;
    const double cut_m = (std::abs(left_m) - std::abs(1.0 / k)) * std::tan(std::abs(piece.turn_rad) / 2);
    const double half_m = piece.length_m / 2 + cut_m;
    const double from_middle_m = s - piece.station_m - piece.length_m / 2;
    if (std::abs(closed_ ? std::remainder(from_middle_m, length_m_) : from_middle_m) < half_m) {
      s = piece.station_m - cut_m;
    }
  }
  const PathPoint point = at(s);
  return point.position_m + left_m * left_of(point.heading_rad);
}

PathPlace RoadPath::nearest(const Eigen::Vector2d& point_m) const {
  PathPlace nearest;
  double nearest_m2 = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const Piece& piece = pieces_[i];
    const double low_m = !closed_ && i == 0 ? -1e9 : 0,
                 high_m = !closed_ && i + 1 == pieces_.size() ? 1e9 : piece.length_m;
    const Eigen::Vector2d offset = point_m - piece.start.position_m;
    const double k = piece.start.curvature_1pm, heading_rad = piece.start.heading_rad;
    double along_m = offset.dot(direction(heading_rad));
    if (k != 0) {
      const Eigen::Vector2d from_centre = offset - left_of(heading_rad) / k;
      const double outwards_rad = heading_rad - std::copysign(kPi / 2, k);
      along_m = wrap_rad(std::atan2(from_centre.y(), from_centre.x()) - outwards_rad - piece.turn_rad / 2) / k +
                piece.length_m / 2;
    }
    const double station_m =
        piece.station_m + (k == 0 ? std::clamp(along_m, low_m, high_m) : std::clamp(along_m, 0.0, piece.length_m));
    const PathPoint place = at(station_m);
    const double distance_m2 = (point_m - place.position_m).squaredNorm();
    if (distance_m2 >= nearest_m2) continue;
    nearest_m2 = distance_m2;
    nearest = {station_m, (point_m - place.position_m).dot(left_of(place.heading_rad))};
  }
  return nearest;
}

std::vector<double> RoadPath::joints_m() const {
  std::vector<double> joints_m;
  for (const Piece& piece : pieces_) joints_m.push_back(piece.station_m);
  joints_m.push_back(length_m_);
  return joints_m;
}

}  // namespace roadvec
