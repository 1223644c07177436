#include "tools/simulate/world_builder.h"

#include <algorithm>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

using Points = std::vector<Eigen::Vector2d>;

constexpr double kStep_m = 0.5;         ///< of outlines along the road: 4 mm off an arc of 8 m radius
constexpr double kLongestFace_m = 1.0;  ///< so that the truth tells seen from unseen metre by metre

/// Stations [from_m, to_m].
struct Stretch {
  double from_m = 0, to_m = 0;
};

double sign(Side side) { return side == Side::left ? 1.0 : -1.0; }

class Builder {
 public:
  Builder(const Scene& scene, const RoadPath& path) : scene_(scene), path_(path) {}

  Expected<BuiltWorld> run() {
    for (const Side side : {Side::left, Side::right}) add_sidewalk(side);
    for (const WallSpec& wall : scene_.walls) add_walls(wall);
    for (const PoleSpec& pole : scene_.poles) add_poles(pole);
    for (const ParkedCarSpec& cars : scene_.parked_cars) add_parked_cars(cars);
    auto world = World::build(std::move(faces_), std::move(poles_));
    if (!world) return tl::unexpected(world.error());
    return BuiltWorld{std::move(*world), std::move(truth_)};
  }

 private:
  void add_sidewalk(Side side);
  void add_sidewalk_piece(Side side, Stretch stretch, double radius_from_m, double radius_to_m);
  void add_walls(const WallSpec& wall);
  void add_front(const WallSpec& wall, Stretch stretch, bool side_walls);
  void add_poles(const PoleSpec& pole);
  void add_parked_cars(const ParkedCarSpec& cars);
  void add_parked_car(const ParkedCarSpec& cars, double middle_m);
  void add_faces(const Points& points_m, const Face& like);
  void add_truth(std::string_view kind, double height_m, std::size_t first);

  [[nodiscard]] double kerb_m() const { return scene_.road.width_m / 2; }
  [[nodiscard]] Eigen::Vector2d beside(Side side, double station_m, double outwards_m) const {
    return path_.beside(station_m, sign(side) * outwards_m);
  }
  [[nodiscard]] Points parallel(Side side, Stretch stretch, double outwards_m) const;
  [[nodiscard]] std::vector<KerbGap> gaps_of(Side side) const;
  [[nodiscard]] std::vector<Stretch> clear_of_gaps(const RowSpec& row, double setback_m) const;
  [[nodiscard]] bool is_clear(Side side, Stretch stretch) const;

  const Scene& scene_;
  const RoadPath& path_;
  std::vector<Face> faces_;
  std::vector<Pole> poles_;
  std::vector<TruthLine> truth_;
};

/// Faces from point to point, cut into pieces of kLongestFace_m.
void Builder::add_faces(const Points& points_m, const Face& like) {
  for (std::size_t i = 0; i + 1 < points_m.size(); ++i) {
    const Eigen::Vector2d leg = points_m[i + 1] - points_m[i];
    if (leg.norm() < 1e-6) continue;
    const int pieces = static_cast<int>(std::ceil(leg.norm() / kLongestFace_m - 1e-9));
    for (int k = 0; k < pieces; ++k) {
      Face face = like;
      face.a_m = k == 0 ? points_m[i] : faces_.back().b_m;
      face.b_m = k + 1 == pieces ? points_m[i + 1] : Eigen::Vector2d(points_m[i] + leg * (k + 1) / pieces);
      faces_.push_back(face);
    }
  }
}

void Builder::add_truth(std::string_view kind, double height_m, std::size_t first) {
  truth_.push_back({kind, height_m, static_cast<std::int32_t>(first), static_cast<std::int32_t>(faces_.size())});
}

Points Builder::parallel(Side side, Stretch stretch, double outwards_m) const {
  Points points_m;
  const int steps = std::max(1, static_cast<int>(std::ceil((stretch.to_m - stretch.from_m) / kStep_m)));
  for (int i = 0; i <= steps; ++i) {
    const double share = static_cast<double>(i) / steps;
    const double s = i == steps ? stretch.to_m : stretch.from_m + share * (stretch.to_m - stretch.from_m);
    const Eigen::Vector2d point_m = beside(side, s, outwards_m);
    if (points_m.empty() || (point_m - points_m.back()).norm() > 1e-6) points_m.push_back(point_m);
  }
  return points_m;
}

/// The side's gaps by station; on a closed road also as seen one lap earlier and later.
std::vector<KerbGap> Builder::gaps_of(Side side) const {
  std::vector<KerbGap> gaps;
  for (const KerbGap& gap : scene_.road.gaps) {
    if (gap.side != side) continue;
    for (const double lap : {-1.0, 0.0, 1.0}) {
      if (lap != 0 && !path_.closed()) continue;
      gaps.push_back(gap);
      gaps.back().at_m += lap * path_.length_m();
    }
  }
  std::sort(gaps.begin(), gaps.end(), [](const KerbGap& a, const KerbGap& b) { return a.at_m < b.at_m; });
  return gaps;
}

/// The row's stations without the gaps. Houses keep their setback from a side street's kerbs too, and half a metre more
/// than the rounding from a driveway's.
std::vector<Stretch> Builder::clear_of_gaps(const RowSpec& row, double setback_m) const {
  const double end_m = row.maybe_to_m.value_or(path_.length_m());
  std::vector<Stretch> stretches;
  double from_m = row.from_m;
  for (const KerbGap& gap : gaps_of(row.side)) {
    const double half_m = gap.width_m / 2 + std::min(setback_m, gap.radius_m + 0.5);
    const double stop_m = std::min(gap.at_m - half_m, end_m);
    if (stop_m > from_m) stretches.push_back({from_m, stop_m});
    from_m = std::max(from_m, gap.at_m + half_m);
  }
  if (end_m > from_m) stretches.push_back({from_m, end_m});
  return stretches;
}

bool Builder::is_clear(Side side, Stretch stretch) const {
  for (const KerbGap& gap : gaps_of(side)) {
    const double half_m = gap.width_m / 2 + gap.radius_m;
    if (stretch.to_m > gap.at_m - half_m && stretch.from_m < gap.at_m + half_m) return false;
  }
  return true;
}

void Builder::add_sidewalk(Side side) {
  const std::vector<KerbGap> gaps = gaps_of(side);
  const double length_m = path_.length_m();
  if (!path_.closed()) {
    double from_m = 0, radius_m = 0;
    for (const KerbGap& gap : gaps) {
      add_sidewalk_piece(side, {from_m, gap.at_m - gap.width_m / 2}, radius_m, gap.radius_m);
      from_m = gap.at_m + gap.width_m / 2;
      radius_m = gap.radius_m;
    }
    return add_sidewalk_piece(side, {from_m, length_m}, radius_m, 0);
  }
  for (std::size_t i = 0; i + 1 < gaps.size(); ++i) {
    if (gaps[i].at_m < 0 || gaps[i].at_m >= length_m) continue;
    add_sidewalk_piece(side, {gaps[i].at_m + gaps[i].width_m / 2, gaps[i + 1].at_m - gaps[i + 1].width_m / 2},
                       gaps[i].radius_m, gaps[i + 1].radius_m);
  }
  if (!gaps.empty()) return;
  const Face kerb{{}, {}, scene_.road.kerb_height_m, scene_.road.kerb_height_m, Material::kerb, Material::sidewalk};
  Points inner_m = parallel(side, {0, length_m}, kerb_m());
  Points outer_m = parallel(side, {0, length_m}, kerb_m() + scene_.road.sidewalk_m);
  inner_m.back() = inner_m.front();
  outer_m.back() = outer_m.front();
  std::reverse(side == Side::left ? outer_m.begin() : inner_m.begin(),
               side == Side::left ? outer_m.end() : inner_m.end());
  const std::size_t first = faces_.size();
  add_faces(inner_m, kerb);
  add_truth("curb", kerb.height_m, first);
  add_faces(outer_m, kerb);
}

/// The raised ground between two gaps: along the kerb, with its corners rounded into the gaps, and back behind the
/// houses.
void Builder::add_sidewalk_piece(Side side, Stretch stretch, double radius_from_m, double radius_to_m) {
  if (stretch.to_m - stretch.from_m < radius_from_m + radius_to_m + 0.01) return;
  const double outer_m = kerb_m() + scene_.road.sidewalk_m;
  Points kerb_line_m{beside(side, stretch.from_m, outer_m)};
  const auto round_corner = [&](double station_m, double inwards, double radius_m, bool leaving) {
    const int steps = radius_m > 0 ? std::max(2, static_cast<int>(std::ceil(radius_m * kPi / 2 / kStep_m))) : 0;
    for (int i = 0; i < steps; ++i) {
      const double share = static_cast<double>(leaving ? i + 1 : i) / steps;
      const double angle_rad = kPi / 2 * (leaving ? 1 - share : share);
      kerb_line_m.push_back(beside(side, station_m + inwards * radius_m * (1 - std::cos(angle_rad)),
                                   kerb_m() + radius_m * (1 - std::sin(angle_rad))));
    }
  };
  round_corner(stretch.from_m, 1.0, radius_from_m, false);
  for (const auto& point_m : parallel(side, {stretch.from_m + radius_from_m, stretch.to_m - radius_to_m}, kerb_m())) {
    kerb_line_m.push_back(point_m);
  }
  round_corner(stretch.to_m, -1.0, radius_to_m, true);
  Points back_m = parallel(side, stretch, outer_m);
  std::reverse(back_m.begin(), back_m.end());
  kerb_line_m.push_back(back_m.front());
  if (side == Side::right) {
    std::reverse(kerb_line_m.begin(), kerb_line_m.end());
    std::reverse(back_m.begin(), back_m.end());
  }
  const Face kerb{{}, {}, scene_.road.kerb_height_m, scene_.road.kerb_height_m, Material::kerb, Material::sidewalk};
  const std::size_t first = faces_.size();
  add_faces(kerb_line_m, kerb);
  add_truth("curb", kerb.height_m, first);
  add_faces(back_m, kerb);
}

void Builder::add_front(const WallSpec& wall, Stretch stretch, bool side_walls) {
  const double front_m = kerb_m() + wall.setback_m;
  Points line_m = parallel(wall.row.side, stretch, front_m);
  if (side_walls && wall.depth_m > 0) {
    line_m.insert(line_m.begin(), beside(wall.row.side, stretch.from_m, front_m + wall.depth_m));
    line_m.push_back(beside(wall.row.side, stretch.to_m, front_m + wall.depth_m));
  }
  const std::size_t first = faces_.size();
  add_faces(line_m, {{}, {}, wall.height_m, 0, Material::wall, Material::wall});
  add_truth("barrier", wall.height_m, first);
}

void Builder::add_walls(const WallSpec& wall) {
  if (!wall.points_m.empty()) {
    const std::size_t first = faces_.size();
    add_faces(wall.points_m, {{}, {}, wall.height_m, 0, Material::wall, Material::wall});
    return add_truth("barrier", wall.height_m, first);
  }
  for (const Stretch& stretch : clear_of_gaps(wall.row, wall.setback_m)) {
    if (wall.length_m == 0) {
      const bool ring = path_.closed() && stretch.to_m - stretch.from_m >= path_.length_m() - 1e-6;
      add_front(wall, stretch, !ring);
      continue;
    }
    for (double s = stretch.from_m; s + 0.5 * wall.length_m < stretch.to_m; s += wall.length_m + wall.spacing_m) {
      add_front(wall, {s, std::min(s + wall.length_m, stretch.to_m)}, true);
    }
  }
}

void Builder::add_poles(const PoleSpec& pole) {
  const auto add = [&](const Eigen::Vector2d& centre_m) {
    poles_.push_back({centre_m, pole.radius_m, pole.height_m, pole.material});
  };
  for (const auto& point_m : pole.points_m) add(point_m);
  if (!pole.points_m.empty()) return;
  const double end_m = pole.row.maybe_to_m.value_or(path_.length_m());
  for (double s = pole.row.from_m; s <= end_m; s += pole.every_m) {
    if (is_clear(pole.row.side, {s - 0.5, s + 0.5})) add(beside(pole.row.side, s, kerb_m() + pole.setback_m));
  }
}

void Builder::add_parked_cars(const ParkedCarSpec& cars) {
  const double end_m = cars.row.maybe_to_m.value_or(path_.length_m());
  for (double s = cars.row.from_m; s + cars.length_m <= end_m; s += cars.length_m + cars.spacing_m) {
    if (is_clear(cars.row.side, {s - 0.5, s + cars.length_m + 0.5})) add_parked_car(cars, s + cars.length_m / 2);
  }
}

void Builder::add_parked_car(const ParkedCarSpec& cars, double middle_m) {
  const Side side = cars.row.side;
  const PathPoint road = path_.at(middle_m);
  const Eigen::Vector2d centre_m = beside(side, middle_m, kerb_m() - cars.clearance_m - cars.width_m / 2);
  const Eigen::Vector2d ahead(std::cos(road.heading_rad), std::sin(road.heading_rad));
  const Eigen::Vector2d to_road = Eigen::Vector2d(ahead.y(), -ahead.x()) * sign(side);
  const Eigen::Vector2d x = ahead * cars.length_m / 2 * sign(side), y = to_road * cars.width_m / 2;
  // Counter-clockwise; the first three sides are those that the road sees: one end, the long side, the other end.
  const Points outline_m{centre_m - x - y, centre_m - x + y, centre_m + x + y, centre_m + x - y};
  const Face like{{}, {}, cars.height_m, cars.height_m, Material::car, Material::car};
  const std::size_t first = faces_.size();
  add_faces(outline_m, like);
  add_truth("vehicle_row", cars.height_m, first);
  add_faces({outline_m.back(), outline_m.front()}, like);
}

}  // namespace

Expected<BuiltWorld> build_world(const Scene& scene, const RoadPath& path) { return Builder(scene, path).run(); }

}  // namespace roadvec
