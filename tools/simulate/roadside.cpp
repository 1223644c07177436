#include "tools/simulate/roadside.h"

#include <algorithm>
#include <cmath>

#include "tools/simulate/movers.h"

namespace roadvec {
namespace {

constexpr double kLongestPiece_m = 1.0;  ///< so that the truth tells seen from unseen metre by metre
constexpr double kStep_m = 0.5;          ///< of lines along the road: 4 mm off an arc of 8 m radius

double sign(Side side) { return side == Side::left ? 1.0 : -1.0; }

Eigen::Vector2d beside(const RoadLine& line, Side side, double station_m, double outwards_m) {
  return line.path.beside(station_m, sign(side) * (line.spec.width_m / 2 + outwards_m));
}

double end_of(const RoadLine& line, const RowSpec& row) { return row.maybe_to_m.value_or(line.path.length_m()); }

/// True in or beside a driveway.
bool in_driveway(const RoadLine& line, Side side, double station_m, double margin_m) {
  for (const DrivewaySpec& driveway : line.spec.driveways) {
    const double off_m = station_m - driveway.at_m;
    const double away_m = std::abs(line.path.closed() ? std::remainder(off_m, line.path.length_m()) : off_m);
    if (driveway.side == side && away_m < driveway.width_m / 2 + margin_m) return true;
  }
  return false;
}

/// Cut into pieces of one length, none longer than kLongestPiece_m.
std::vector<Eigen::Vector2d> cut(const std::vector<Eigen::Vector2d>& points_m) {
  std::vector<Eigen::Vector2d> pieces_m;
  for (std::size_t i = 0; i + 1 < points_m.size(); ++i) {
    const Eigen::Vector2d leg = points_m[i + 1] - points_m[i];
    const int count = static_cast<int>(std::ceil(leg.norm() / kLongestPiece_m - 1e-9));
    for (int k = 0; k < count; ++k) pieces_m.emplace_back(points_m[i] + leg * k / count);
  }
  if (!points_m.empty()) pieces_m.push_back(points_m.back());
  return pieces_m;
}

}  // namespace

void Roadside::add_all(const RoadLine& line) {
  for (const WallSpec& wall : line.spec.walls) {
    if (is_there(wall.row.when, phase_)) add_walls(line, wall);
  }
  for (const HedgeSpec& hedge : line.spec.hedges) {
    if (is_there(hedge.row.when, phase_)) add_hedges(line, hedge);
  }
  for (const PoleSpec& pole : line.spec.poles) {
    if (is_there(pole.row.when, phase_)) add_poles(line, pole);
  }
  for (const ParkedCarSpec& cars : line.spec.parked_cars) {
    if (is_there(cars.row.when, phase_)) add_parked_cars(line, cars);
  }
}

std::int32_t Roadside::add_truth(std::string_view kind, double height_m, const Eigen::Vector2d& a_m,
                                 const Eigen::Vector2d& b_m, bool continues) {
  truth_.push_back({kind, height_m, a_m, b_m, continues, phase_});
  return static_cast<std::int32_t>(truth_.size() - 1);
}

double Roadside::base_m(const Eigen::Vector2d& point_m) const {
  const Sheet sheet = ground_.off_road_m(point_m) < 0 ? Sheet::road : Sheet::beside;
  return ground_.height_m(sheet, point_m.x(), point_m.y());
}

/// The row's stations where nothing comes in: driveways stay open, and things keep off other roads what they keep off
/// their own, up to 2.5 m.
std::vector<Roadside::Stretch> Roadside::clear_stretches(const RoadLine& line, const RowSpec& row,
                                                         double setback_m) const {
  constexpr double kLook_m = 0.25, kTolerance_m = 0.25, kMost_m = 2.5, kDriveway_m = 1.0;
  std::vector<Stretch> stretches;
  bool open = false;
  const double end_m = end_of(line, row);
  const int steps = static_cast<int>(std::ceil((end_m - row.from_m) / kLook_m));
  for (int i = 0; i <= steps; ++i) {
    const double station_m = std::min(row.from_m + i * kLook_m, end_m);
    const bool clear =
        !in_driveway(line, row.side, station_m, kDriveway_m) &&
        ground_.off_road_m(beside(line, row.side, station_m, setback_m)) >= std::min(setback_m, kMost_m) - kTolerance_m;
    if (clear && !open) stretches.push_back({station_m, station_m});
    if (clear) stretches.back().to_m = station_m;
    open = clear;
  }
  std::erase_if(stretches, [](const Stretch& stretch) { return stretch.to_m - stretch.from_m < 0.5; });
  return stretches;
}

void Roadside::add_walls(const RoadLine& line, const WallSpec& wall) {
  if (!wall.points_m.empty()) return add_wall(wall, wall.points_m);
  for (const Stretch& stretch : clear_stretches(line, wall.row, wall.setback_m)) {
    if (wall.length_m == 0) {
      const bool ring = line.path.closed() && stretch.to_m - stretch.from_m >= line.path.length_m() - 1e-6;
      add_front(line, wall, stretch, !ring);
      continue;
    }
    for (double s = stretch.from_m; s + 0.5 * wall.length_m < stretch.to_m; s += wall.length_m + wall.spacing_m) {
      add_front(line, wall, {s, std::min(s + wall.length_m, stretch.to_m)}, true);
    }
  }
}

void Roadside::add_front(const RoadLine& line, const WallSpec& wall, Stretch stretch, bool side_walls) {
  Points points_m;
  const int steps = std::max(1, static_cast<int>(std::ceil((stretch.to_m - stretch.from_m) / kStep_m)));
  for (int i = 0; i <= steps; ++i) {
    const double station_m = std::lerp(stretch.from_m, stretch.to_m, static_cast<double>(i) / steps);
    const Eigen::Vector2d point_m = beside(line, wall.row.side, station_m, wall.setback_m);
    if (points_m.empty() || (point_m - points_m.back()).norm() > 1e-6) points_m.push_back(point_m);
  }
  if (side_walls && wall.depth_m > 0) {
    points_m.insert(points_m.begin(), beside(line, wall.row.side, stretch.from_m, wall.setback_m + wall.depth_m));
    points_m.push_back(beside(line, wall.row.side, stretch.to_m, wall.setback_m + wall.depth_m));
  }
  add_wall(wall, points_m);
}

void Roadside::add_wall(const WallSpec& wall, const Points& points_m) {
  constexpr double kRailDepth_m = 0.32, kPostEvery_m = 2.0, kPostRadius_m = 0.05;
  const bool rail = wall.kind == WallKind::rail;
  Face face;
  face.bottom_m = rail ? std::max(0.0, wall.height_m - kRailDepth_m) : 0;
  face.top_m = wall.height_m;
  face.material = rail ? Material::metal : wall.kind == WallKind::fence ? Material::fence : Material::wall;
  face.pattern = wall.kind == WallKind::fence     ? Pattern::palings
                 : wall.kind == WallKind::windows ? Pattern::windows
                                                  : Pattern::solid;
  const Points line_m = cut(points_m);
  double next_post_m = 0;
  for (std::size_t i = 0; i + 1 < line_m.size(); ++i) {
    face.a_m = line_m[i];
    face.b_m = line_m[i + 1];
    face.base_a_m = base_m(face.a_m);
    face.base_b_m = base_m(face.b_m);
    face.face = add_truth("barrier", wall.height_m, face.a_m, face.b_m, i > 0);
    things_.faces.push_back(face);
    if (rail && face.along_m >= next_post_m) {
      things_.poles.push_back({face.a_m, kPostRadius_m, face.base_a_m, wall.height_m, Material::metal});
      next_post_m += kPostEvery_m;
    }
    face.along_m += (face.b_m - face.a_m).norm();
  }
}

void Roadside::add_hedges(const RoadLine& line, const HedgeSpec& hedge) {
  if (!hedge.points_m.empty()) return add_hedge(hedge, hedge.points_m, 0);
  for (const Stretch& stretch : clear_stretches(line, hedge.row, hedge.setback_m)) {
    Points points_m;
    const int steps = std::max(1, static_cast<int>(std::ceil((stretch.to_m - stretch.from_m) / kLongestPiece_m)));
    for (int i = 0; i <= steps; ++i) {
      points_m.push_back(beside(line, hedge.row.side,
                                std::lerp(stretch.from_m, stretch.to_m, static_cast<double>(i) / steps),
                                hedge.setback_m));
    }
    add_hedge(hedge, points_m, sign(hedge.row.side) * hedge.width_m / 2);
  }
}

/// Along the line of its front; its middle lies `left_m` beside that.
void Roadside::add_hedge(const HedgeSpec& hedge, const Points& points_m, double left_m) {
  const Points line_m = cut(points_m);
  for (std::size_t i = 0; i + 1 < line_m.size(); ++i) {
    const Eigen::Vector2d leg = line_m[i + 1] - line_m[i];
    if (leg.norm() < 1e-6) continue;
    Box box;
    box.axis = leg.normalized();
    box.centre_m = (line_m[i] + line_m[i + 1]) / 2 + left_m * Eigen::Vector2d(-box.axis.y(), box.axis.x());
    box.half_length_m = leg.norm() / 2;
    box.half_width_m = hedge.width_m / 2;
    const Ground::Level ground = ground_.level(Sheet::beside, box.centre_m);
    box.base_m = ground.height_m;
    box.gradient = ground.gradient;
    box.top_m = hedge.height_m;
    box.porous_m = hedge.porous_m;
    box.side = box.roof = Material::hedge;
    box.faces.fill(add_truth("vegetation", hedge.height_m, line_m[i], line_m[i + 1], i > 0));
    things_.boxes.push_back(box);
  }
}

void Roadside::add_poles(const RoadLine& line, const PoleSpec& pole) {
  for (const auto& point_m : pole.points_m) add_pole(pole, point_m);
  if (!pole.points_m.empty()) return;
  for (double s = pole.row.from_m; s <= end_of(line, pole.row); s += pole.every_m) {
    const Eigen::Vector2d centre_m = beside(line, pole.row.side, s, pole.setback_m);
    if (in_driveway(line, pole.row.side, s, 0.5) || ground_.off_road_m(centre_m) < std::min(pole.setback_m, 2.5) - 0.1)
      continue;
    add_pole(pole, centre_m);
  }
}

void Roadside::add_pole(const PoleSpec& pole, const Eigen::Vector2d& centre_m) {
  constexpr double kCrownFrom_m = 2.5, kCrownDepth_m = 1.5;
  things_.poles.push_back({centre_m, pole.radius_m, base_m(centre_m), pole.height_m, pole.material});
  if (pole.crown_m == 0 || pole.height_m <= kCrownFrom_m) return;
  Box crown;
  crown.centre_m = centre_m;
  crown.half_length_m = crown.half_width_m = pole.crown_m;
  crown.base_m = base_m(centre_m);
  crown.bottom_m = kCrownFrom_m;
  crown.top_m = pole.height_m;
  crown.porous_m = kCrownDepth_m;
  crown.side = crown.roof = Material::tree;
  things_.boxes.push_back(crown);
}

void Roadside::add_parked_cars(const RoadLine& line, const ParkedCarSpec& cars) {
  constexpr double kMargin_m = 0.5;
  const double outwards_m = -cars.clearance_m - cars.width_m / 2;
  const auto clear = [&](double station_m) {
    const double off_m = ground_.off_road_m(beside(line, cars.row.side, station_m, outwards_m));
    return off_m > outwards_m - 0.3 && !in_driveway(line, cars.row.side, station_m, 0);
  };
  for (double s = cars.row.from_m; s + cars.length_m <= end_of(line, cars.row); s += cars.length_m + cars.spacing_m) {
    const double middle_m = s + cars.length_m / 2;
    const Eigen::Vector2d place_m = beside(line, cars.row.side, middle_m, outwards_m);
    if (noise_at({place_m.x(), place_m.y(), 0}, 0.01) < cars.missing) continue;
    if (clear(s - kMargin_m) && clear(middle_m) && clear(s + cars.length_m + kMargin_m))
      add_parked_car(line, cars, middle_m);
  }
}

void Roadside::add_parked_car(const RoadLine& line, const ParkedCarSpec& cars, double middle_m) {
  const Side side = cars.row.side;
  const double heading_rad = line.path.at(middle_m).heading_rad;
  const Eigen::Vector2d ahead(std::cos(heading_rad), std::sin(heading_rad));
  const Eigen::Vector2d centre_m = beside(line, side, middle_m, -cars.clearance_m - cars.width_m / 2);
  const Ground::Level ground = ground_.level(ground_.off_road_m(centre_m) < 0 ? Sheet::road : Sheet::beside, centre_m);
  const Eigen::Vector2d x = ahead * cars.length_m / 2;
  const Eigen::Vector2d y = Eigen::Vector2d(ahead.y(), -ahead.x()) * sign(side) * cars.width_m / 2;
  // The three sides that the road sees: the back, the long side, the front.
  const Points outline_m{centre_m - x - y, centre_m - x + y, centre_m + x + y, centre_m + x - y};
  std::array<std::int32_t, 4> faces{Hit::kOther, Hit::kOther, Hit::kOther, Hit::kOther};
  const std::array<std::size_t, 3> shown{0, side == Side::left ? 2U : 3U, 1};
  for (std::size_t i = 0; i < 3; ++i) {
    faces[shown[i]] = add_truth("vehicle_row", cars.height_m, outline_m[i], outline_m[i + 1], i > 0);
  }
  for (Box box : car_boxes(centre_m, ahead, cars.length_m, cars.width_m, cars.height_m)) {
    box.base_m = ground.height_m + ground.gradient.dot(box.centre_m - centre_m);
    box.gradient = ground.gradient;
    if (box.bottom_m > 0 && box.half_length_m == cars.length_m / 2) box.faces = faces;
    things_.boxes.push_back(box);
  }
}

}  // namespace roadvec
