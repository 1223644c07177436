#include "tools/simulate/scenery.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace roadvec {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

}  // namespace

struct Scenery::Crossing {
  double range_m, share;
  std::uint32_t kerb;
};

/// A beam in plan, from the grid's corner.
struct Scenery::Line {
  std::array<double, 2> place_m, slope, inverse;

  Line(const Beam& beam, const Eigen::Vector2d& corner_m) {
    for (std::size_t i = 0; i < 2; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      place_m[i] = beam.origin_m[axis] - corner_m[axis];
      slope[i] = beam.direction[axis];
      inverse[i] = 1 / slope[i];
    }
  }

  /// Range at which the beam comes into the rectangle from the corner to `size_m`: 0 inside, infinite if it never does.
  [[nodiscard]] double enters_m(const std::array<double, 2>& size_m) const {
    double from_m = 0, to_m = kFar;
    for (std::size_t i = 0; i < 2; ++i) {
      if (slope[i] == 0 && (place_m[i] < 0 || place_m[i] > size_m[i])) return kFar;
      if (slope[i] == 0) continue;
      from_m = std::max(from_m, ((slope[i] > 0 ? 0 : size_m[i]) - place_m[i]) * inverse[i]);
      to_m = std::min(to_m, ((slope[i] > 0 ? size_m[i] : 0) - place_m[i]) * inverse[i]);
    }
    return from_m <= to_m ? from_m : kFar;
  }
};

/// A beam's way through squares in rows and columns, one at a time [AmanatidesWoo1987]. Which of the two comes next
/// cannot be foretold, so a step chooses by values and not by branches.
struct Scenery::Walk {
  double from_m;
  double next_x_m, next_y_m;    ///< range at which the next column and the next row begin
  double width_x_m, width_y_m;  ///< range between two of them
  int column, row, step_x, step_y;

  /// From a range on, at which the beam is in columns and rows [low, high].
  Walk(const Line& line, double square_m, const std::array<int, 2>& low, const std::array<int, 2>& high, double start_m)
      : from_m(start_m), step_x(line.slope[0] < 0 ? -1 : 1), step_y(line.slope[1] < 0 ? -1 : 1) {
    const double per_m = 1 / square_m;
    const auto place = [&](std::size_t i, int& cell, double& next_m, double& width_m) {
      cell = std::clamp(static_cast<int>((line.place_m[i] + start_m * line.slope[i]) * per_m), low[i], high[i]);
      const bool stays = line.slope[i] == 0;
      width_m = stays ? kFar : square_m * std::abs(line.inverse[i]);
      next_m = stays ? kFar : (square_m * (cell + (line.slope[i] > 0 ? 1 : 0)) - line.place_m[i]) * line.inverse[i];
    };
    place(0, column, next_x_m, width_x_m);
    place(1, row, next_y_m, width_y_m);
  }

  [[nodiscard]] double next_m() const { return std::min(next_x_m, next_y_m); }

  void advance() {
    const bool along_x = next_x_m < next_y_m;
    from_m = along_x ? next_x_m : next_y_m;
    next_x_m += along_x ? width_x_m : 0;
    next_y_m += along_x ? 0 : width_y_m;
    column += along_x ? step_x : 0;
    row += along_x ? 0 : step_y;
  }
};

Hit Scenery::cast(const Beam& beam, double range_m) const {
  Hit hit{range_m, 0, Material::road, Hit::kNothing};
  const Line line(beam, corner_m_);
  const double enters_m = line.enters_m({columns_ * kBlockCells * kCell_m, rows_ * kBlockCells * kCell_m});
  if (!(enters_m < range_m)) return hit;
  Walk blocks(line, kBlockCells * kCell_m, {0, 0}, {columns_ - 1, rows_ - 1}, enters_m);
  while (blocks.from_m < range_m && blocks.column >= 0 && blocks.row >= 0 && blocks.column < columns_ &&
         blocks.row < rows_) {
    const double top_m = block_tops_m_[static_cast<std::size_t>(blocks.row * columns_ + blocks.column)];
    const double to_m = std::min(blocks.next_m(), range_m);
    if (std::min(beam.height_m(blocks.from_m), beam.height_m(to_m)) <= top_m) {
      // A beam on its way down is above everything in the block until here.
      if (beam.height_m(blocks.from_m) > top_m) blocks.from_m = (top_m - beam.origin_m.z()) / beam.direction.z();
      meet_block(line, blocks, beam, to_m, hit);
      if (hit.face != Hit::kNothing) return hit;
    }
    blocks.advance();
  }
  hit.range_m = range_m;
  return hit;
}

void Scenery::meet_block(const Line& line, const Walk& block, const Beam& beam, double end_m, Hit& hit) const {
  const int low_x = block.column * kBlockCells, low_y = block.row * kBlockCells;
  const std::size_t first = cell_index(low_x, low_y);
  const Level* const levels = levels_.data() + first;
  std::optional<bool> maybe_over_road;  // absent: not followed since the beam was high above an edge
  Walk walk(line, kCell_m, {low_x, low_y}, {low_x + kBlockCells - 1, low_y + kBlockCells - 1}, block.from_m);
  double height_m = beam.height_m(walk.from_m);
  for (; walk.from_m < end_m; walk.advance()) {
    const int column = walk.column - low_x, row = walk.row - low_y;
    if (((column | row) & ~(kBlockCells - 1)) != 0) return;
    const auto index = static_cast<std::size_t>(row * kBlockCells + column);
    const double to_m = std::min(walk.next_m(), end_m), next_height_m = beam.height_m(to_m);
    const double lowest_m = std::min(height_m, next_height_m);
    height_m = next_height_m;
    const Level level = levels[index];
    if (lowest_m > level.ground_m) maybe_over_road.reset();
    if (lowest_m > level.top_m) continue;
    const Cell& here = cells_[first + index];
    hit.range_m = to_m;
    if (here.solid != here.last) meet_solids(here, beam, walk.from_m, to_m, hit);
    if (lowest_m <= level.ground_m && here.even) {
      maybe_over_road = here.on_road;
      meet_even(here, corner_m_ + kCell_m * Eigen::Vector2d(walk.column, walk.row), beam, {walk.from_m, hit.range_m},
                hit);
    } else if (lowest_m <= level.ground_m) {
      if (here.first == here.solid) maybe_over_road = here.on_road;
      if (!maybe_over_road) maybe_over_road = on_road(beam.place_m(walk.from_m));
      meet_low(here, beam, walk.from_m, hit.range_m, *maybe_over_road, hit);
    }
    if (hit.face != Hit::kNothing) return;
  }
}

void Scenery::meet_solids(const Cell& cell, const Beam& beam, double from_m, double to_m, Hit& hit) const {
  constexpr std::uint32_t kIndex = (1U << kKindShift) - 1;
  for (std::uint32_t i = cell.solid; i < cell.last; ++i) {
    const std::uint32_t index = items_[i] & kIndex;
    const auto kind = static_cast<Kind>(items_[i] >> kKindShift);
    const double before_m = std::min(to_m, hit.range_m);
    if (kind == Kind::face) {
      meet(things_.faces[index], beam, from_m, before_m, hit);
    } else if (kind == Kind::pole) {
      meet(things_.poles[index], beam, from_m, before_m, hit);
    } else {
      meet(things_.boxes[index], beam, from_m, before_m, hit);
    }
  }
}

/// Ranges in [from, to) at which the beam crosses the road's edge, nearest first.
std::size_t Scenery::crossings_in(const Cell& cell, const Beam& beam, double from_m, double to_m,
                                  Crossing* crossings) const {
  std::size_t count = 0;
  const Eigen::Vector2d step = beam.direction.head<2>(), origin_m = beam.origin_m.head<2>();
  for (std::uint32_t i = cell.first; i < cell.solid; ++i) {
    const Kerb& kerb = things_.kerbs[items_[i]];
    const Eigen::Vector2d along = kerb.b_m - kerb.a_m, offset = kerb.a_m - origin_m;
    const double across = cross(step, along);
    const double range_m = cross(offset, along) / across, share = cross(offset, step) / across;
    if (!(range_m >= from_m && range_m < to_m && share >= 0 && share < 1)) continue;
    std::size_t place = count++;
    for (; place > 0 && crossings[place - 1].range_m > range_m; --place) crossings[place] = crossings[place - 1];
    crossings[place] = {range_m, share, items_[i]};
  }
  return count;
}

/// The beam through a cell in which it may come down to the ground: from one crossing of the road's edge to the next.
bool Scenery::meet_low(const Cell& cell, const Beam& beam, double from_m, double to_m, bool& over_road,
                       Hit& hit) const {
  std::array<Crossing, kMostKerbs> crossings;
  const std::size_t count = crossings_in(cell, beam, from_m, to_m, crossings.data());
  const auto sheet = [&] { return over_road ? Sheet::road : Sheet::beside; };
  for (std::size_t i = 0; i < count; ++i) {
    if (meet_ground(sheet(), beam, from_m, crossings[i].range_m, hit)) return true;
    if (meet_kerb(crossings[i], beam, over_road, hit)) return true;
    from_m = crossings[i].range_m;
  }
  return meet_ground(sheet(), beam, from_m, to_m, hit);
}

/// The ground of an even cell: bilinear between its corners, nearly a plane.
void Scenery::meet_even(const Cell& cell, const Eigen::Vector2d& corner_m, const Beam& beam,
                        const std::array<double, 2>& range_m, Hit& hit) const {
  const double a = cell.corners_m[0], b = cell.corners_m[1] - a, c = cell.corners_m[2] - a;
  const double d = cell.corners_m[3] - a - b - c;
  const auto u = [&](double t_m) { return (beam.origin_m.x() + t_m * beam.direction.x() - corner_m.x()) / kCell_m; };
  const auto v = [&](double t_m) { return (beam.origin_m.y() + t_m * beam.direction.y() - corner_m.y()) / kCell_m; };
  const auto clearance_m = [&](double t_m) {
    return beam.height_m(t_m) - (a + u(t_m) * (b + v(t_m) * d) + v(t_m) * c);
  };
  const double high_m = clearance_m(range_m[0]), low_m = clearance_m(range_m[1]);
  if (high_m > 0 && low_m > 0) return;
  double at_m = range_m[0];
  if (high_m > 0) {
    const double sinks = (high_m - low_m) / (range_m[1] - range_m[0]);
    at_m += high_m / sinks;
    at_m = std::clamp(at_m + clearance_m(at_m) / sinks, range_m[0], range_m[1]);
  }
  const Eigen::Vector2d gradient = Eigen::Vector2d(b + v(at_m) * d, c + u(at_m) * d) / kCell_m;
  settle(cell.on_road ? Sheet::road : Sheet::beside, gradient, beam, range_m[0], at_m, hit);
}

bool Scenery::meet_kerb(const Crossing& crossing, const Beam& beam, bool& over_road, Hit& hit) const {
  const Kerb& kerb = things_.kerbs[crossing.kerb];
  const Eigen::Vector2d along = kerb.b_m - kerb.a_m;
  const double outwards = cross(along, beam.direction.head<2>()) / along.norm();
  over_road = outwards < 0;
  if (over_road) return false;
  const double z_m = beam.height_m(crossing.range_m);
  const double top_m = std::lerp(kerb.top_a_m, kerb.top_b_m, crossing.share);
  const double foot_m = std::lerp(kerb.foot_a_m, kerb.foot_b_m, crossing.share);
  if (z_m > top_m || top_m - foot_m < 1e-4) return false;
  // The upper edge is a quarter of a circle: the higher the beam, the farther back it meets it.
  const double round_m = std::min(kerb.round_m, top_m - foot_m), up_m = z_m - (top_m - round_m);
  double back_m = 0, cosine = outwards;
  if (up_m > 0) {
    back_m = round_m - std::sqrt(std::max(0.0, round_m * round_m - up_m * up_m));
    const double tilt = up_m / round_m;
    cosine = std::abs(outwards * std::sqrt(1 - tilt * tilt) - beam.direction.z() * tilt);
  }
  hit = {crossing.range_m + std::min(back_m / std::max(outwards, 0.1), 0.1), std::min(cosine, 1.0), Material::kerb,
         kerb.face};
  return true;
}

/// The first place in [from, to) where the beam comes down to the sheet.
bool Scenery::meet_ground(Sheet sheet, const Beam& beam, double from_m, double to_m, Hit& hit) const {
  const auto clearance_m = [&](double range_m) {
    return beam.height_m(range_m) - ground_.height_m(sheet, beam.origin_m.x() + range_m * beam.direction.x(),
                                                     beam.origin_m.y() + range_m * beam.direction.y());
  };
  constexpr double kStep_m = 0.7, kNear_m = 0.1;
  double low_m = from_m, low_clearance_m = clearance_m(from_m);
  double high_m = to_m, high_clearance_m = clearance_m(to_m);
  if (low_clearance_m > 0 && high_clearance_m > 0) {
    // Between two places above the sheet the beam may graze a crest.
    if (high_clearance_m > kNear_m && low_clearance_m > kNear_m) return false;
    const int steps = static_cast<int>(std::ceil(beam.direction.head<2>().norm() * (to_m - from_m) / kStep_m));
    for (int i = 1; i < steps; ++i) {
      high_m = std::lerp(from_m, to_m, static_cast<double>(i) / steps);
      high_clearance_m = clearance_m(high_m);
      if (high_clearance_m <= 0) break;
      low_m = high_m;
      low_clearance_m = high_clearance_m;
    }
    if (high_clearance_m > 0) return false;
  }
  // Where the straight line through both clearances comes down, until it is close enough.
  double at_m = low_m;
  for (int i = 0; i < 6 && low_clearance_m > 0; ++i) {
    at_m = std::lerp(low_m, high_m, low_clearance_m / (low_clearance_m - high_clearance_m));
    const double here_m = clearance_m(at_m);
    if (std::abs(here_m) < 1e-5) break;
    (here_m > 0 ? low_m : high_m) = at_m;
    (here_m > 0 ? low_clearance_m : high_clearance_m) = here_m;
  }
  settle(sheet, ground_.level(sheet, beam.place_m(at_m)).gradient, beam, from_m, at_m, hit);
  return true;
}

/// The hit where a beam has come down to the ground, with the bump that is there.
void Scenery::settle(Sheet sheet, const Eigen::Vector2d& gradient, const Beam& beam, double from_m, double range_m,
                     Hit& hit) const {
  const Eigen::Vector2d point_m = beam.place_m(range_m);
  const Material material = sheet == Sheet::road ? Material::road : ground_.material(point_m);
  const double sinks = gradient.dot(beam.direction.head<2>()) - beam.direction.z();
  const double rough_m = roughness_m_[static_cast<std::size_t>(material)];
  if (rough_m > 0) {
    // Met farther off along the beam the flatter that comes in.
    constexpr double kBump_m = 0.05, kFarthest_m = 0.3;
    const double bump_m = rough_m * (2 * noise_at({point_m.x(), point_m.y(), 0}, kBump_m) - 1);
    range_m = std::max(from_m, range_m - std::clamp(bump_m / std::max(sinks, 1e-3), -kFarthest_m, kFarthest_m));
  }
  hit = {range_m, std::clamp(sinks / std::sqrt(1 + gradient.squaredNorm()), 0.0, 1.0), material, Hit::kGround};
}

Eigen::Vector2d Scenery::cell_corner_m(std::size_t index) const {
  const int block = static_cast<int>(index) / kCellsOfBlock, cell = static_cast<int>(index) % kCellsOfBlock;
  return corner_m_ + kCell_m * Eigen::Vector2d(block % columns_ * kBlockCells + cell % kBlockCells,
                                               block / columns_ * kBlockCells + cell / kBlockCells);
}

bool Scenery::on_road(const Eigen::Vector2d& point_m) const {
  const Eigen::Vector2d at = (point_m - corner_m_) / kCell_m;
  if (!(at.x() >= 0 && at.y() >= 0 && at.x() < columns_ * kBlockCells && at.y() < rows_ * kBlockCells)) return false;
  const int column = static_cast<int>(at.x()), row = static_cast<int>(at.y());
  const Cell& cell = cells_[cell_index(column, row)];
  if (cell.first == cell.solid) return cell.on_road;
  // Each edge between the cell's middle and the point takes the other side.
  const Eigen::Vector2d middle_m = corner_m_ + kCell_m * Eigen::Vector2d(column + 0.5, row + 0.5),
                        way = point_m - middle_m;
  bool on_road = cell.on_road;
  for (std::uint32_t i = cell.first; i < cell.solid; ++i) {
    const Kerb& kerb = things_.kerbs[items_[i]];
    const Eigen::Vector2d along = kerb.b_m - kerb.a_m, offset = kerb.a_m - middle_m;
    const double across = cross(way, along);
    const double part = cross(offset, along) / across, share = cross(offset, way) / across;
    if (part >= 0 && part < 1 && share >= 0 && share < 1) on_road = !on_road;
  }
  return on_road;
}

double Scenery::height_at(const Eigen::Vector2d& point_m) const {
  return ground_.height_m(on_road(point_m) ? Sheet::road : Sheet::beside, point_m.x(), point_m.y());
}

}  // namespace roadvec
