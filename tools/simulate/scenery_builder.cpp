#include <algorithm>
#include <cmath>

#include "tools/simulate/scenery.h"

namespace roadvec {
namespace {

/// Above the highest sample of the ground: bumps, and what bilinear samples miss.
constexpr float kAbove_m = 0.04F;

/// True if the segment a-b touches the square [low, high] (separating axes: both sides of the square, the normal).
bool touches(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& low,
             const Eigen::Vector2d& high) {
  for (int axis = 0; axis < 2; ++axis) {
    if (std::max(a[axis], b[axis]) < low[axis] || std::min(a[axis], b[axis]) > high[axis]) return false;
  }
  const Eigen::Vector2d along = b - a, middle = (low + high) / 2 - a, half = (high - low) / 2;
  return std::abs(along.x() * middle.y() - along.y() * middle.x()) <=
         std::abs(along.x()) * half.y() + std::abs(along.y()) * half.x();
}

/// Seen from above, and its highest point.
struct Footprint {
  Eigen::Vector2d low_m, high_m;
  double top_m = 0;
};

Footprint footprint(const Kerb& kerb) {
  return {kerb.a_m.cwiseMin(kerb.b_m), kerb.a_m.cwiseMax(kerb.b_m), std::max(kerb.top_a_m, kerb.top_b_m)};
}

Footprint footprint(const Face& face) {
  return {face.a_m.cwiseMin(face.b_m), face.a_m.cwiseMax(face.b_m),
          std::max(face.base_a_m, face.base_b_m) + face.top_m};
}

Footprint footprint(const Pole& pole) {
  const Eigen::Vector2d reach = Eigen::Vector2d::Constant(pole.radius_m);
  return {pole.centre_m - reach, pole.centre_m + reach, pole.base_m + pole.top_m};
}

Footprint footprint(const Box& box) {
  const Eigen::Vector2d along = box.half_length_m * box.axis.cwiseAbs();
  const Eigen::Vector2d reach =
      along + box.half_width_m * Eigen::Vector2d(std::abs(box.axis.y()), std::abs(box.axis.x()));
  return {box.centre_m - reach, box.centre_m + reach, box.base_m + box.top_m + box.gradient.cwiseAbs().dot(reach)};
}

}  // namespace

struct Scenery::Builder {
  Scenery& scenery;
  std::vector<std::vector<std::uint32_t>> items;

  void place_grid() {
    Eigen::Vector2d low = scenery.ground_.low_m(), high = scenery.ground_.high_m();
    const auto take = [&](const auto& things) {
      for (const auto& thing : things) {
        const Footprint print = footprint(thing);
        low = low.cwiseMin(print.low_m);
        high = high.cwiseMax(print.high_m);
      }
    };
    take(scenery.things_.faces);
    take(scenery.things_.poles);
    take(scenery.things_.boxes);
    // Cells lie on the ground's samples, so that whether a cell's middle is on the road is known exactly.
    const Eigen::Vector2d cells = ((scenery.ground_.low_m() - low) / kCell_m).array().ceil().matrix();
    scenery.corner_m_ = scenery.ground_.low_m() - kCell_m * (cells + Eigen::Vector2d::Ones());
    const Eigen::Vector2d stray = Eigen::Vector2d::Constant(kStray_m);
    const Eigen::Vector2d blocks = (high + stray - scenery.corner_m_) / (kCell_m * kBlockCells);
    scenery.columns_ = static_cast<int>(blocks.x()) + 1;
    scenery.rows_ = static_cast<int>(blocks.y()) + 1;
    items.resize(static_cast<std::size_t>(scenery.columns_ * scenery.rows_ * kCellsOfBlock));
    scenery.cells_.resize(items.size());
    scenery.levels_.resize(items.size());
  }

  template <class Thing, class Meets>
  void add(const std::vector<Thing>& things, Kind kind, Meets&& meets) {
    const Eigen::Vector2d slack = Eigen::Vector2d::Constant(kStray_m), cell = Eigen::Vector2d::Constant(kCell_m);
    for (std::uint32_t i = 0; i < things.size(); ++i) {
      const Footprint print = footprint(things[i]);
      const Eigen::Vector2d low = (print.low_m - slack - scenery.corner_m_) / kCell_m;
      const Eigen::Vector2d high = (print.high_m + slack - scenery.corner_m_) / kCell_m;
      for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y) {
        for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) {
          const Eigen::Vector2d corner_m = scenery.corner_m_ + kCell_m * Eigen::Vector2d(x, y);
          if (!meets(things[i], corner_m - slack, corner_m + cell + slack)) continue;
          const std::size_t c = scenery.cell_index(x, y);
          items[c].push_back(static_cast<std::uint32_t>(kind) << kKindShift | i);
          scenery.levels_[c].top_m = std::max(scenery.levels_[c].top_m, static_cast<float>(print.top_m) + kAbove_m);
        }
      }
    }
  }

  /// Where the ground is and how high it comes; before the solid things are added.
  void level_cells() {
    for (std::size_t c = 0; c < items.size(); ++c) {
      Cell& cell = scenery.cells_[c];
      auto ground_m = static_cast<float>(Ground::kNone_m);
      const Eigen::Vector2d corner_m = scenery.cell_corner_m(c);
      cell.on_road = scenery.ground_.off_road_m(corner_m + Eigen::Vector2d::Constant(kCell_m / 2)) < 0;
      for (const Sheet sheet : {Sheet::road, Sheet::beside}) {
        if (items[c].empty() && cell.on_road != (sheet == Sheet::road)) continue;
        ground_m = std::max(ground_m, level(cell.patches[static_cast<std::size_t>(sheet)], sheet, corner_m));
      }
      scenery.levels_[c] = {ground_m, ground_m};
    }
  }

  /// The highest point of a sheet in a cell and kStray_m around it; sets the patch.
  float level(Patch& patch, Sheet sheet, const Eigen::Vector2d& corner_m) const {
    constexpr int kSamples = static_cast<int>(kCell_m / Ground::kStep_m);
    static_assert(kStray_m <= Ground::kStep_m);
    constexpr double kEven_m = 0.0015;  // half of what bumps on the road add
    const auto height_m = [&](int i, int j) {
      const Eigen::Vector2d point_m = corner_m + Ground::kStep_m * Eigen::Vector2d(i, j);
      return scenery.ground_.height_m(sheet, point_m.x(), point_m.y());
    };
    const double a = height_m(0, 0), b = height_m(kSamples, 0), c = height_m(0, kSamples),
                 d = height_m(kSamples, kSamples);
    patch.corners_m = {static_cast<float>(a), static_cast<float>(b), static_cast<float>(c), static_cast<float>(d)};
    const auto material = [&](int i, int j) {
      return sheet == Sheet::road ? Material::road
                                  : scenery.ground_.material(corner_m + Ground::kStep_m * Eigen::Vector2d(i, j));
    };
    patch.material = material(0, 0);
    patch.even = patch.uniform = true;
    double highest_m = a;
    for (int i = -1; i <= kSamples + 1; ++i) {
      for (int j = -1; j <= kSamples + 1; ++j) {
        const double here_m = height_m(i, j);
        highest_m = std::max(highest_m, here_m);
        patch.uniform = patch.uniform && material(i, j) == patch.material;
        if (i < 0 || j < 0 || i > kSamples || j > kSamples) continue;
        const double u = static_cast<double>(i) / kSamples, v = static_cast<double>(j) / kSamples;
        patch.even = patch.even && std::abs(here_m - std::lerp(std::lerp(a, b, u), std::lerp(c, d, u), v)) < kEven_m;
      }
    }
    return static_cast<float>(highest_m) + kAbove_m;
  }

  void top_blocks() {
    scenery.block_tops_m_.assign(items.size() / kCellsOfBlock, static_cast<float>(Ground::kNone_m));
    for (std::size_t c = 0; c < items.size(); ++c) {
      float& top_m = scenery.block_tops_m_[c / kCellsOfBlock];
      top_m = std::max(top_m, scenery.levels_[c].top_m);
    }
  }
};

Expected<Scenery> Scenery::build(Ground ground, Things things, const double (&roughness_m)[kMaterialCount]) {
  Scenery scenery(std::move(ground), std::move(things));
  std::copy(std::begin(roughness_m), std::end(roughness_m), scenery.roughness_m_.begin());
  Builder builder{scenery, {}};
  builder.place_grid();
  builder.add(scenery.things_.kerbs, Kind::kerb, [](const Kerb& kerb, const auto& low, const auto& high) {
    return touches(kerb.a_m, kerb.b_m, low, high);
  });
  builder.level_cells();
  std::vector<std::uint32_t> kerb_counts;
  for (const auto& cell : builder.items) kerb_counts.push_back(static_cast<std::uint32_t>(cell.size()));
  builder.add(scenery.things_.faces, Kind::face, [](const Face& face, const auto& low, const auto& high) {
    return touches(face.a_m, face.b_m, low, high);
  });
  const auto anywhere = [](const auto&, const auto&, const auto&) { return true; };
  builder.add(scenery.things_.poles, Kind::pole, anywhere);
  builder.add(scenery.things_.boxes, Kind::box, anywhere);
  builder.top_blocks();
  for (std::size_t c = 0; c < builder.items.size(); ++c) {
    if (kerb_counts[c] > kMostKerbs) {
      const Eigen::Vector2d at_m = scenery.cell_corner_m(c);
      return fail("the road's edge winds too much near x " + std::to_string(at_m.x()) + ", y " +
                  std::to_string(at_m.y()) + "; move the roads apart or raise corner_radius_m");
    }
    Cell& cell = scenery.cells_[c];
    cell.first = static_cast<std::uint32_t>(scenery.items_.size());
    cell.solid = cell.first + kerb_counts[c];
    scenery.items_.insert(scenery.items_.end(), builder.items[c].begin(), builder.items[c].end());
    cell.last = static_cast<std::uint32_t>(scenery.items_.size());
  }
  return scenery;
}

}  // namespace roadvec
