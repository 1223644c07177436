#include "tools/simulate/road_edges.h"

#include <algorithm>
#include <clipper.hpp>
#include <cmath>
#include <limits>

#include "core/base/angle.h"

namespace roadvec {
namespace {

using ClipperLib::Paths;
using Points = std::vector<Eigen::Vector2d>;

constexpr double kClipperUnits_1pm = 1e4;  ///< polygon arithmetic is done in tenths of a millimetre
constexpr double kArcTolerance_m = 0.002;
constexpr double kLongestPiece_m = 0.5;  ///< so that the truth tells seen from unseen, and follows a kerb's ramps
constexpr double kRamp_m = 1.0;          ///< from the kerb's full height down to a driveway
constexpr double kVergeSlope = -0.04;    ///< verges fall away from the road
constexpr double kIslandRounding_m = 0.5;

ClipperLib::IntPoint units(const Eigen::Vector2d& point_m) {
  return {std::llround(point_m.x() * kClipperUnits_1pm), std::llround(point_m.y() * kClipperUnits_1pm)};
}

ClipperLib::Path units(const Points& points_m) {
  ClipperLib::Path path;
  for (const Eigen::Vector2d& point_m : points_m) path.push_back(units(point_m));
  return path;
}

/// Grown by `by_m` (shrunk below 0) with round corners.
Paths grown(const Paths& area, double by_m, ClipperLib::EndType ends = ClipperLib::etClosedPolygon) {
  ClipperLib::ClipperOffset offset(2.0, kArcTolerance_m * kClipperUnits_1pm);
  offset.AddPaths(area, ClipperLib::jtRound, ends);
  Paths result;
  offset.Execute(result, by_m * kClipperUnits_1pm);
  return result;
}

Paths combined(ClipperLib::ClipType how, const Paths& area, const Paths& with) {
  ClipperLib::Clipper clipper;
  clipper.AddPaths(area, ClipperLib::ptSubject, true);
  clipper.AddPaths(with, ClipperLib::ptClip, true);
  Paths result;
  clipper.Execute(how, result, ClipperLib::pftNonZero, ClipperLib::pftNonZero);
  return result;
}

double sign(Side side) { return side == Side::left ? 1.0 : -1.0; }

/// Along the road at a distance from its centre line, a point at each `step_m` of what is bent.
Points parallel(const RoadPath& path, double from_m, double to_m, double left_m, double step_m) {
  const int steps = std::max(1, static_cast<int>(std::ceil((to_m - from_m) / step_m)));
  Points points_m;
  for (int i = 0; i <= steps; ++i)
    points_m.push_back(path.beside(std::lerp(from_m, to_m, static_cast<double>(i) / steps), left_m));
  return points_m;
}

/// The line itself; straight parts have no points between their ends, so that their edges come out straight.
Points centre_line(const RoadPath& path) {
  Points points_m;
  const std::vector<double> joints_m = path.joints_m();
  for (std::size_t i = 0; i + 1 < joints_m.size(); ++i) {
    const double from_m = joints_m[i], to_m = joints_m[i + 1];
    const bool straight = path.at((from_m + to_m) / 2).curvature_1pm == 0;
    const Points part_m = parallel(path, from_m, to_m, 0, straight ? to_m - from_m : 0.25);
    points_m.insert(points_m.end(), part_m.begin(), part_m.end() - 1);
  }
  if (!path.closed()) points_m.push_back(path.beside(path.length_m(), 0));
  return points_m;
}

/// From a metre beyond the road's edge on one side to `depth_m` inside it, tapered by 45 degrees.
Points bulge_outline(const RoadLine& line, const BulgeSpec& bulge) {
  const double outer_m = line.spec.width_m / 2 + (bulge.depth_m > 0 ? 1.0 : -1.0);
  const double inner_m = line.spec.width_m / 2 - bulge.depth_m;
  const double taper_m = std::abs(outer_m - inner_m), side = sign(bulge.row.side);
  const double to_m = bulge.row.maybe_to_m.value_or(bulge.row.from_m);
  Points points_m = parallel(line.path, bulge.row.from_m, to_m, side * inner_m, 0.5);
  const Points back_m = parallel(line.path, bulge.row.from_m - taper_m, to_m + taper_m, side * outer_m, 0.5);
  points_m.insert(points_m.end(), back_m.rbegin(), back_m.rend());
  return points_m;
}

void add_outline(Paths& area, const Points& points_m) {
  ClipperLib::Path path = units(points_m);
  if (!ClipperLib::Orientation(path)) ClipperLib::ReversePath(path);
  area.push_back(std::move(path));
}

Paths island_outlines(const Scene& scene, int phase) {
  Paths islands;
  for (const IslandSpec& island : scene.islands) {
    if (is_there(island.when, phase)) add_outline(islands, island.points_m);
  }
  return grown(grown(islands, -kIslandRounding_m), kIslandRounding_m);
}

Paths area_of(const Scene& scene, const std::vector<RoadLine>& lines, int phase) {
  Paths area, taken;
  for (const RoadLine& line : lines) {
    const Paths road = grown({units(centre_line(line.path))}, line.spec.width_m / 2,
                             line.path.closed() ? ClipperLib::etClosedLine : ClipperLib::etOpenButt);
    area.insert(area.end(), road.begin(), road.end());
    for (const BulgeSpec& bulge : line.spec.bulges) {
      if (is_there(bulge.row.when, phase)) add_outline(bulge.depth_m > 0 ? taken : area, bulge_outline(line, bulge));
    }
  }
  area = combined(ClipperLib::ctUnion, area, {});
  area = grown(grown(area, scene.corner_radius_m), -scene.corner_radius_m);
  const Paths islands = island_outlines(scene, phase);
  taken.insert(taken.end(), islands.begin(), islands.end());
  return combined(ClipperLib::ctDifference, area, taken);
}

/// Which edge of which road a point on the outline belongs to.
struct Owner {
  const RoadLine* line = nullptr;
  PathPlace place;
  bool at_end = false;
  double off_m = std::numeric_limits<double>::infinity();
};

void consider(const RoadLine& line, const Eigen::Vector2d& point_m, Owner& owner) {
  const PathPlace place = line.path.nearest(point_m);
  const double side_m = std::abs(std::abs(place.left_m) - line.spec.width_m / 2);
  const double end_m = line.path.closed()
                           ? std::numeric_limits<double>::infinity()
                           : std::min(std::abs(place.station_m), std::abs(place.station_m - line.path.length_m()));
  const double beyond_m =
      line.path.closed() ? 0 : std::max({0.0, -place.station_m, place.station_m - line.path.length_m()});
  const bool at_end = end_m < side_m && std::abs(place.left_m) < line.spec.width_m / 2;
  const double off_m = at_end ? end_m : std::hypot(side_m, beyond_m);
  if (off_m < owner.off_m) owner = {&line, place, at_end, off_m};
}

/// The kerb at a station: its own height, that of a stretch, or down a ramp to a driveway.
double kerb_height_m(const RoadLine& line, Side side, double station_m, int phase) {
  const RoadSpec& road = line.spec;
  double height_m = road.kerb_height_m;
  for (const EdgeSpec& edge : road.edges) {
    const double to_m = edge.row.maybe_to_m.value_or(line.path.length_m() + 1);
    if (edge.row.side == side && is_there(edge.row.when, phase) && station_m >= edge.row.from_m && station_m <= to_m) {
      height_m = edge.height_m;
    }
  }
  for (const DrivewaySpec& driveway : road.driveways) {
    if (driveway.side != side) continue;
    const double off_m = line.path.closed() ? std::remainder(station_m - driveway.at_m, line.path.length_m())
                                            : station_m - driveway.at_m;
    const double share = std::clamp((std::abs(off_m) - driveway.width_m / 2) / kRamp_m, 0.0, 1.0);
    height_m = std::min(height_m, std::lerp(driveway.height_m, std::max(height_m, driveway.height_m), share));
  }
  return height_m;
}

RoadEdge edge_of_road(const Owner& owner, const Eigen::Vector2d& a_m, const Eigen::Vector2d& b_m, int phase) {
  const RoadLine& line = *owner.line;
  const RoadSpec& road = line.spec;
  RoadEdge edge{.a_m = a_m, .b_m = b_m, .crown = road.crown_percent / 100, .crest_m = road.width_m / 2};
  edge.near = edge.far = Material::road;
  edge.open = owner.at_end;
  if (edge.open) return edge;
  const Side side = owner.place.left_m > 0 ? Side::left : Side::right;
  edge.kerb_a_m = kerb_height_m(line, side, line.path.nearest(a_m).station_m, phase);
  edge.kerb_b_m = kerb_height_m(line, side, line.path.nearest(b_m).station_m, phase);
  edge.round_m = road.kerb_round_m;
  edge.slope = road.sidewalk_percent / 100;
  edge.near_m = road.sidewalk_m;
  edge.near = Material::sidewalk;
  edge.far = road.beyond;
  for (const EdgeSpec& stretch : road.edges) {
    const double to_m = stretch.row.maybe_to_m.value_or(line.path.length_m() + 1);
    if (stretch.row.side != side || !is_there(stretch.row.when, phase) || !stretch.maybe_beyond) continue;
    if (owner.place.station_m < stretch.row.from_m || owner.place.station_m > to_m) continue;
    edge.near = edge.far = *stretch.maybe_beyond;
    edge.slope = kVergeSlope;
  }
  return edge;
}

/// The island that a piece of the outline goes round, if any.
const IslandSpec* island_at(const Scene& scene, const Eigen::Vector2d& point_m, int phase) {
  for (const IslandSpec& island : scene.islands) {
    if (!is_there(island.when, phase)) continue;
    const ClipperLib::Path outline = units(island.points_m);
    ClipperLib::IntPoint at = units(point_m);
    if (ClipperLib::PointInPolygon(at, outline) != 0) return &island;
    for (std::size_t i = 0; i < island.points_m.size(); ++i) {
      const Eigen::Vector2d &a_m = island.points_m[i], &b_m = island.points_m[(i + 1) % island.points_m.size()];
      const double share = std::clamp((point_m - a_m).dot(b_m - a_m) / (b_m - a_m).squaredNorm(), 0.0, 1.0);
      if ((a_m + share * (b_m - a_m) - point_m).norm() < 0.01) return &island;
    }
  }
  return nullptr;
}

/// Like the road that it comes into, but bare.
RoadSpec side_street(const RoadSpec& road, const RoadPath& path, const MouthSpec& mouth) {
  RoadSpec street;
  street.waypoints = {{path.beside(mouth.at_m, 0)},
                      {path.beside(mouth.at_m, sign(mouth.side) * (road.width_m / 2 + mouth.length_m))}};
  street.width_m = mouth.width_m;
  street.crown_percent = road.crown_percent;
  street.kerb_height_m = road.kerb_height_m;
  street.kerb_round_m = road.kerb_round_m;
  street.sidewalk_m = road.sidewalk_m;
  street.sidewalk_percent = road.sidewalk_percent;
  street.beyond = road.beyond;
  return street;
}

}  // namespace

bool is_there(When when, int phase) { return when == When::always || (when == When::before) == (phase == 0); }

Expected<std::vector<RoadLine>> road_lines(const Scene& scene, int phase) {
  std::vector<RoadLine> lines;
  for (std::size_t i = 0; i < scene.roads.size(); ++i) {
    const RoadSpec& road = scene.roads[i];
    if (!is_there(road.when, phase)) continue;
    auto path = RoadPath::create(road.waypoints, road.closed);
    if (!path) return fail("road " + std::to_string(i + 1) + ": " + path.error().message);
    for (const MouthSpec& mouth : road.mouths) {
      const RoadSpec street = side_street(road, *path, mouth);
      auto side_path = RoadPath::create(street.waypoints, false);
      if (!side_path) return fail("road " + std::to_string(i + 1) + ", mouth: " + side_path.error().message);
      lines.push_back({street, std::move(*side_path)});
    }
    lines.push_back({road, std::move(*path)});
  }
  return lines;
}

std::vector<RoadEdge> road_edges(const Scene& scene, const std::vector<RoadLine>& lines, int phase) {
  std::vector<RoadEdge> edges;
  for (ClipperLib::Path& outline : area_of(scene, lines, phase)) {
    ClipperLib::ReversePath(outline);
    Points points_m;
    for (const ClipperLib::IntPoint& point : outline) {
      const Eigen::Vector2d point_m =
          Eigen::Vector2d(static_cast<double>(point.X), static_cast<double>(point.Y)) / kClipperUnits_1pm;
      if (points_m.empty() || (point_m - points_m.back()).norm() > 0.002) points_m.push_back(point_m);
    }
    if (points_m.size() < 3) continue;
    points_m.push_back(points_m.front());
    const std::size_t first = edges.size();
    for (std::size_t i = 0; i + 1 < points_m.size(); ++i) {
      const Eigen::Vector2d leg = points_m[i + 1] - points_m[i];
      const int count = std::max(1, static_cast<int>(std::ceil(leg.norm() / kLongestPiece_m - 1e-9)));
      for (int k = 0; k < count; ++k) {
        const Eigen::Vector2d a_m = points_m[i] + leg * k / count;
        const Eigen::Vector2d b_m =
            k + 1 == count ? points_m[i + 1] : Eigen::Vector2d(points_m[i] + leg * (k + 1) / count);
        const Eigen::Vector2d middle_m = (a_m + b_m) / 2;
        Owner owner;
        for (const RoadLine& line : lines) consider(line, middle_m, owner);
        RoadEdge edge = edge_of_road(owner, a_m, b_m, phase);
        if (const IslandSpec* island = island_at(scene, middle_m, phase)) {
          edge.open = false;
          edge.kerb_a_m = edge.kerb_b_m = island->kerb_height_m;
          edge.near = edge.far = island->top;
          edge.round_m = owner.line->spec.kerb_round_m;
        }
        edge.continues = edges.size() > first;
        edges.push_back(edge);
      }
    }
  }
  return edges;
}

}  // namespace roadvec
