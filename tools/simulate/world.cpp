#include "tools/simulate/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace roadvec {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
/// Cells take in what lies this close to them, so that no rounding on a cell's border loses a face.
constexpr double kSlack_m = 1e-6;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// True if the segment a-b touches the square [low, high] (separating axes: both sides of the square, the normal).
bool touches(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& low,
             const Eigen::Vector2d& high) {
  for (int axis = 0; axis < 2; ++axis) {
    if (std::max(a[axis], b[axis]) < low[axis] || std::min(a[axis], b[axis]) > high[axis]) return false;
  }
  const Eigen::Vector2d along = b - a, middle = (low + high) / 2 - a, half = (high - low) / 2;
  return std::abs(cross(along, middle)) <= std::abs(along.x()) * half.y() + std::abs(along.y()) * half.x();
}

}  // namespace

/// A beam on its way, in plan too, and the ground it is over.
struct World::Beam {
  Eigen::Vector3d origin_m, direction;
  Eigen::Vector2d from_m, step;  ///< seen from above; step is not a unit vector
  double ground_m = 0;
  double ground_range_m = kFar;  ///< where the beam would meet that ground
  Material ground = Material::road;

  Beam(const Eigen::Vector3d& from, const Eigen::Vector3d& towards)
      : origin_m(from), direction(towards), from_m(from.head<2>()), step(towards.head<2>()) {
    stand_over(0, Material::road);
  }
  void stand_over(double height_m, Material material) {
    ground_m = height_m;
    ground = material;
    ground_range_m = direction.z() < 0 ? (ground_m - origin_m.z()) / direction.z() : kFar;
  }
  [[nodiscard]] double above_ground_m(double range_m) const {
    return origin_m.z() + range_m * direction.z() - ground_m;
  }
};

struct World::Crossing {
  double range_m = 0;
  std::int32_t item = 0;
};

Expected<World> World::build(std::vector<Face> faces, std::vector<Pole> poles) {
  World world;
  world.faces_ = std::move(faces);
  world.poles_ = std::move(poles);
  world.place_grid();
  const auto things = world.things_by_cell();
  for (std::size_t i = 0; i < things.size(); ++i) {
    if (things[i].size() > kMostInCell) {
      const double x_m =
          world.corner_m_.x() + kCell_m * static_cast<double>(i % static_cast<std::size_t>(world.columns_));
      const double y_m =
          world.corner_m_.y() + kCell_m * static_cast<double>(i / static_cast<std::size_t>(world.columns_));
      return fail("more than " + std::to_string(kMostInCell) + " things stand within two metres of x " +
                  std::to_string(x_m) + ", y " + std::to_string(y_m) + "; space them out");
    }
    const auto first = static_cast<std::uint32_t>(world.items_.size());
    world.items_.insert(world.items_.end(), things[i].begin(), things[i].end());
    world.cells_.push_back({first, static_cast<std::uint32_t>(world.items_.size())});
  }
  return world;
}

void World::place_grid() {
  Eigen::Vector2d low(kFar, kFar), high(-kFar, -kFar);
  for (const Face& face : faces_) {
    low = low.cwiseMin(face.a_m).cwiseMin(face.b_m);
    high = high.cwiseMax(face.a_m).cwiseMax(face.b_m);
  }
  for (const Pole& pole : poles_) {
    low = low.cwiseMin(pole.centre_m - Eigen::Vector2d::Constant(pole.radius_m));
    high = high.cwiseMax(pole.centre_m + Eigen::Vector2d::Constant(pole.radius_m));
  }
  if (!(low.x() <= high.x())) low = high = {0, 0};
  corner_m_ = low - Eigen::Vector2d::Constant(kCell_m);
  columns_ = static_cast<int>((high.x() - corner_m_.x()) / kCell_m) + 2;
  rows_ = static_cast<int>((high.y() - corner_m_.y()) / kCell_m) + 2;
}

std::vector<std::vector<std::int32_t>> World::things_by_cell() const {
  std::vector<std::vector<std::int32_t>> things(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  const auto add = [&](const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m, std::int32_t item, auto&& meets) {
    const Eigen::Vector2d low = (low_m - corner_m_) / kCell_m, high = (high_m - corner_m_) / kCell_m;
    for (int y = static_cast<int>(low.y() - kSlack_m); y <= static_cast<int>(high.y() + kSlack_m); ++y) {
      for (int x = static_cast<int>(low.x() - kSlack_m); x <= static_cast<int>(high.x() + kSlack_m); ++x) {
        const Eigen::Vector2d cell_m = corner_m_ + kCell_m * Eigen::Vector2d(x, y);
        const Eigen::Vector2d slack = Eigen::Vector2d::Constant(kSlack_m);
        if (!meets(cell_m - slack, cell_m + Eigen::Vector2d::Constant(kCell_m) + slack)) continue;
        things[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x)]
            .push_back(item);
      }
    }
  };
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const Eigen::Vector2d &a = faces_[i].a_m, &b = faces_[i].b_m;
    add(a.cwiseMin(b), a.cwiseMax(b), static_cast<std::int32_t>(i),
        [&](const Eigen::Vector2d& low, const Eigen::Vector2d& high) { return touches(a, b, low, high); });
  }
  for (std::size_t i = 0; i < poles_.size(); ++i) {
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(poles_[i].radius_m);
    add(poles_[i].centre_m - reach, poles_[i].centre_m + reach, ~static_cast<std::int32_t>(i),
        [](const Eigen::Vector2d&, const Eigen::Vector2d&) { return true; });
  }
  return things;
}

/// Ranges in [from, to) at which the beam meets the cell's things, nearest first.
std::size_t World::crossings_in(const Cell& cell, const Beam& beam, double from, double to, Crossing* crossings) const {
  std::size_t count = 0;
  for (std::uint32_t i = cell.first; i < cell.last; ++i) {
    const std::int32_t item = items_[i];
    double range_m = kFar;
    if (item >= 0) {
      const Face& face = faces_[static_cast<std::size_t>(item)];
      const Eigen::Vector2d along = face.b_m - face.a_m, offset = face.a_m - beam.from_m;
      const double across = cross(beam.step, along);
      const double share = cross(offset, beam.step) / across;
      // Half open, so that a beam through the joint of two faces meets one of them.
      if (across != 0 && share >= 0 && share < 1) range_m = cross(offset, along) / across;
    } else {
      const Pole& pole = poles_[static_cast<std::size_t>(~item)];
      const Eigen::Vector2d offset = pole.centre_m - beam.from_m;
      const double a = beam.step.squaredNorm(), b = beam.step.dot(offset);
      const double under_root = b * b - a * (offset.squaredNorm() - pole.radius_m * pole.radius_m);
      if (under_root > 0) range_m = (b - std::sqrt(under_root)) / a;
    }
    if (range_m < from || !(range_m < to)) continue;
    std::size_t place = count++;
    for (; place > 0 && crossings[place - 1].range_m > range_m; --place) crossings[place] = crossings[place - 1];
    crossings[place] = {range_m, item};
  }
  return count;
}

/// What the beam does where it crosses a thing: true if it ends there, else the ground may have changed.
bool World::meet(const Crossing& crossing, Beam& beam, Hit& hit) const {
  const double above_m = beam.above_ground_m(crossing.range_m);
  if (crossing.item < 0) {
    const Pole& pole = poles_[static_cast<std::size_t>(~crossing.item)];
    if (above_m > pole.height_m) return false;
    const Eigen::Vector2d normal = (beam.from_m + crossing.range_m * beam.step - pole.centre_m) / pole.radius_m;
    hit = {crossing.range_m, std::abs(normal.dot(beam.step)), pole.material, Hit::kPole};
    return true;
  }
  const Face& face = faces_[static_cast<std::size_t>(crossing.item)];
  const Eigen::Vector2d along = face.b_m - face.a_m;
  const double inwards = cross(along, beam.step);
  if (face.rise_m > 0 && inwards < 0) {
    beam.stand_over(beam.ground_m - face.rise_m, Material::road);
    return false;
  }
  if (above_m <= face.height_m) {
    hit = {crossing.range_m, std::abs(inwards) / along.norm(), face.material, crossing.item};
    return true;
  }
  if (face.rise_m > 0) beam.stand_over(beam.ground_m + face.rise_m, face.top);
  return false;
}

/// A beam's way through the grid, one cell at a time [AmanatidesWoo1987]. Ranges count from the beam's origin.
struct World::Walk {
  std::array<int, 2> cell{}, step{};
  Eigen::Vector2d next_m, width_m;  ///< range at which the next column or row begins; range between two
  double from_m = 0;                ///< where the beam is in the grid: 0, or where it comes in from outside
  bool inside = true;

  Walk(const World& world, const Beam& beam) {
    const std::array<int, 2> counts{world.columns_, world.rows_};
    const Eigen::Vector2d place_m = beam.from_m - world.corner_m_;
    for (std::size_t i = 0; i < 2; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      step[i] = beam.step[axis] < 0 ? -1 : 1;
      const double near_m = step[i] > 0 ? 0 : kCell_m * counts[i];
      if ((place_m[axis] - near_m) * step[i] < 0) from_m = std::max(from_m, (near_m - place_m[axis]) / beam.step[axis]);
    }
    inside = std::isfinite(from_m);
    for (std::size_t i = 0; inside && i < 2; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      const double slope = beam.step[axis], at = (place_m[axis] + from_m * slope) / kCell_m;
      inside = at > -kSlack_m && at < counts[i] + kSlack_m;
      cell[i] = inside ? std::clamp(static_cast<int>(at), 0, counts[i] - 1) : 0;
      width_m[axis] = slope == 0 ? kFar : kCell_m / std::abs(slope);
      next_m[axis] = slope == 0 ? kFar : (kCell_m * (cell[i] + (step[i] > 0 ? 1 : 0)) - place_m[axis]) / slope;
    }
  }

  void advance(const World& world) {
    const std::size_t i = next_m[0] < next_m[1] ? 0 : 1;
    const auto axis = static_cast<Eigen::Index>(i);
    from_m = next_m[axis];
    next_m[axis] += width_m[axis];
    cell[i] += step[i];
    inside = cell[i] >= 0 && cell[i] < (i == 0 ? world.columns_ : world.rows_);
  }
};

Hit World::cast(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double range_m) const {
  Beam beam(origin_m, direction);
  Hit hit{range_m, 0, Material::road, Hit::kNothing};
  const auto on_ground = [&](double before_m) {
    if (beam.ground_range_m > before_m) return false;
    hit = {beam.ground_range_m, std::abs(direction.z()), beam.ground, Hit::kGround};
    return true;
  };
  std::array<Crossing, kMostInCell> crossings;
  for (Walk walk(*this, beam); walk.inside && walk.from_m < range_m; walk.advance(*this)) {
    const double to_m = std::min(walk.next_m.minCoeff(), range_m);
    const Cell& here = cells_[static_cast<std::size_t>(walk.cell[1]) * static_cast<std::size_t>(columns_) +
                              static_cast<std::size_t>(walk.cell[0])];
    const std::size_t count =
        here.first == here.last ? 0 : crossings_in(here, beam, walk.from_m, to_m, crossings.data());
    for (std::size_t i = 0; i < count; ++i) {
      if (on_ground(crossings[i].range_m) || meet(crossings[i], beam, hit)) return hit;
    }
    if (on_ground(to_m)) return hit;
  }
  on_ground(range_m);
  return hit;
}

double World::height_at(const Eigen::Vector2d& point_m) const {
  double height_m = 0;
  for (const Face& face : faces_) {
    // Edges crossed by the ray from the point towards +x, counted by which way they run.
    const bool a_above = face.a_m.y() > point_m.y(), b_above = face.b_m.y() > point_m.y();
    if (a_above == b_above || face.rise_m == 0) continue;
    const double side = cross(face.b_m - face.a_m, point_m - face.a_m);
    if (b_above && side > 0) height_m += face.rise_m;
    if (a_above && side < 0) height_m -= face.rise_m;
  }
  return height_m;
}

}  // namespace roadvec
