#include "tools/simulate/scenery.h"

#include <algorithm>
#include <cmath>

#include "tools/simulate/scenery_cast.h"

namespace roadvec {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

}  // namespace

/// A beam in plan, from the grid's corner.
struct Scenery::Line {
  std::array<double, 2> place_m, slope, inverse;
  std::array<int, 2> ahead;  ///< 1 if it goes up the axis

  Line(const Beam& beam, const Eigen::Vector2d& corner_m) {
    for (std::size_t i = 0; i < 2; ++i) {
      constexpr double kHardly = 1e-300;  // in place of 0, so that everything below stays finite
      const auto axis = static_cast<Eigen::Index>(i);
      place_m[i] = beam.origin_m[axis] - corner_m[axis];
      slope[i] = beam.direction[axis] == 0 ? kHardly : beam.direction[axis];
      inverse[i] = 1 / slope[i];
      ahead[i] = slope[i] > 0 ? 1 : 0;
    }
  }

  /// Range at which the beam comes into the rectangle from the corner to `size_m`: 0 inside, infinite if it never does.
  [[nodiscard]] double enters_m(const std::array<double, 2>& size_m) const {
    double from_m = 0, to_m = kFar;
    for (std::size_t i = 0; i < 2; ++i) {
      const double low_m = -place_m[i] * inverse[i], high_m = (size_m[i] - place_m[i]) * inverse[i];
      from_m = std::max(from_m, std::min(low_m, high_m));
      to_m = std::min(to_m, std::max(low_m, high_m));
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
      : from_m(start_m), step_x(2 * line.ahead[0] - 1), step_y(2 * line.ahead[1] - 1) {
    const double per_m = 1 / square_m;
    const auto place = [&](std::size_t i, int& cell, double& next_m, double& width_m) {
      cell = std::clamp(static_cast<int>((line.place_m[i] + start_m * line.slope[i]) * per_m), low[i], high[i]);
      width_m = square_m * std::abs(line.inverse[i]);
      next_m = (square_m * (cell + line.ahead[i]) - line.place_m[i]) * line.inverse[i];
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

void Scenery::cast(std::span<const Beam> beams, double from_m, std::span<Hit> hits) const {
  Cast cast(beams, from_m, hits);
  const Line line(beams.front(), corner_m_);
  const double enters_m =
      std::max(from_m, line.enters_m({columns_ * kBlockCells * kCell_m, rows_ * kBlockCells * kCell_m}));
  if (!(enters_m < cast.end_m)) return;
  Walk blocks(line, kBlockCells * kCell_m, {0, 0}, {columns_ - 1, rows_ - 1}, enters_m);
  while (blocks.from_m < cast.end_m && blocks.column >= 0 && blocks.row >= 0 && blocks.column < columns_ &&
         blocks.row < rows_) {
    const double top_m = block_tops_m_[static_cast<std::size_t>(blocks.row * columns_ + blocks.column)];
    const double to_m = std::min(blocks.next_m(), cast.end_m);
    if (std::min(cast.lowest_m(blocks.from_m), cast.lowest_m(to_m)) <= top_m) {
      // Beams on their way down are above everything in the block until here.
      if (cast.lowest_m(blocks.from_m) > top_m) blocks.from_m = (top_m - cast.low_m) / cast.sinks;
      meet_block(line, blocks, to_m, cast);
    }
    blocks.advance();
  }
}

void Scenery::meet_block(const Line& line, const Walk& block, double to_m, Cast& cast) const {
  const int low_x = block.column * kBlockCells, low_y = block.row * kBlockCells;
  const std::size_t first = cell_index(low_x, low_y);
  const Level* const levels = levels_.data() + first;
  Walk walk(line, kCell_m, {low_x, low_y}, {low_x + kBlockCells - 1, low_y + kBlockCells - 1}, block.from_m);
  walk.column -= low_x;
  walk.row -= low_y;
  const double low_m = cast.low_m, sinks = cast.sinks;
  double height_m = low_m + walk.from_m * sinks, end_m = to_m;
  cast.low_step = -2;
  for (int step = 0; walk.from_m < end_m; walk.advance(), ++step) {
    if (((walk.column | walk.row) & ~(kBlockCells - 1)) != 0) return;
    const auto index = static_cast<std::size_t>(walk.row * kBlockCells + walk.column);
    const double next_m = std::min(walk.next_m(), end_m), next_height_m = low_m + next_m * sinks;
    const double lowest_m = std::min(height_m, next_height_m);
    height_m = next_height_m;
    if (lowest_m > levels[index].top_m) continue;
    const Cell& here = cells_[first + index];
    if (here.solid != here.last) meet_solids(here, cast);
    if (lowest_m <= levels[index].ground_m) {
      if (step != cast.low_step + 1) cast.followed = 0;
      cast.low_step = step;
      const Eigen::Vector2d corner_m = corner_m_ + kCell_m * Eigen::Vector2d(low_x + walk.column, low_y + walk.row);
      meet_low({here, corner_m, walk.from_m, next_m}, levels[index].ground_m, cast);
    }
    cast.find_end();
    end_m = std::min(end_m, cast.end_m);
  }
}

void Scenery::meet_solids(const Cell& cell, Cast& cast) const {
  constexpr std::uint32_t kIndex = (1U << kKindShift) - 1;
  const auto meet_all = [&](const auto& thing) {
    if (passes_by(thing, cast.beams.front(), cast.stray_m)) return;
    for (std::size_t k = 0; k < cast.beams.size(); ++k) {
      meet(thing, cast.beams[k], cast.from_m, cast.hits[k].range_m, cast.hits[k]);
    }
  };
  for (std::uint32_t i = cell.solid; i < cell.last; ++i) {
    const std::uint32_t index = items_[i] & kIndex;
    const auto kind = static_cast<Kind>(items_[i] >> kKindShift);
    if (kind == Kind::face) {
      meet_all(things_.faces[index]);
    } else if (kind == Kind::pole) {
      meet_all(things_.poles[index]);
    } else {
      meet_all(things_.boxes[index]);
    }
  }
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
    const Eigen::Vector2d offset = kerb.a_m - middle_m;
    const double left_a = cross(way, offset), left_b = cross(way, kerb.b_m - middle_m);
    if ((left_a < 0) == (left_b < 0)) continue;
    const double part = cross(offset, kerb.b_m - kerb.a_m) / (left_b - left_a);
    if (part >= 0 && part < 1) on_road = !on_road;
  }
  return on_road;
}

double Scenery::height_at(const Eigen::Vector2d& point_m) const {
  return ground_.height_m(on_road(point_m) ? Sheet::road : Sheet::beside, point_m.x(), point_m.y());
}

}  // namespace roadvec
