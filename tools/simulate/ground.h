#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "tools/simulate/land.h"
#include "tools/simulate/road_edges.h"

namespace roadvec {

/// The two sheets of ground.
enum class Sheet : std::uint8_t { road, beside };

/// The ground as two sheets of height: the road's surface (land and crown) and what lies beside it (land, kerb, rise of
/// the sidewalk). Both reach past the road's edge as they would go on, so that they are exact up to it; which of them
/// counts where is for the outline to say. Sampled every half metre, bilinear between, in tiles that exist only within
/// kMargin_m of a road: beyond lies nothing.
class Ground {
 public:
  static constexpr double kStep_m = 0.5;
  static constexpr double kMargin_m = 60;
  static constexpr double kNone_m = -1e6;  ///< height where there is no ground

  /// Beyond kReach_m from any road, the ground is `far_rise_m` above the land.
  Ground(const Land& land, const std::vector<RoadEdge>& edges, double far_rise_m, Material far);

  struct Level {
    double height_m = kNone_m;
    Eigen::Vector2d gradient{0, 0};
  };
  [[nodiscard]] double height_m(Sheet sheet, double x_m, double y_m) const;
  [[nodiscard]] Level level(Sheet sheet, const Eigen::Vector2d& point_m) const;
  /// Of the sheet beside the road.
  [[nodiscard]] Material material(const Eigen::Vector2d& point_m) const;
  /// From the nearest road's edge, off the road positive; never more than kReach_m in size.
  [[nodiscard]] double off_road_m(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] bool empty() const { return tiles_.empty(); }
  [[nodiscard]] const Eigen::Vector2d& low_m() const { return low_m_; }
  [[nodiscard]] const Eigen::Vector2d& high_m() const { return high_m_; }

  static constexpr double kReach_m = 8;  ///< twice as far as the ground rises behind a kerb

 private:
  static constexpr int kTileShift = 6, kTileCells = 1 << kTileShift, kTileNodes = kTileCells + 1;
  struct Node {
    float height_m[2];
    float off_road_m;
  };
  struct Tile {
    std::array<Node, kTileNodes * kTileNodes> nodes;
    std::array<Material, kTileNodes * kTileNodes> materials;
  };
  struct Place {
    const Tile* tile = nullptr;
    int node = 0;
    double u = 0, v = 0;  ///< within the square of four nodes, 0..1
  };
  struct Builder;

  [[nodiscard]] Place place(double x_m, double y_m) const {
    const double u = (x_m - low_m_.x()) * (1 / kStep_m), v = (y_m - low_m_.y()) * (1 / kStep_m);
    if (!(u >= 0 && v >= 0 && u < columns_ * kTileCells && v < rows_ * kTileCells)) return {};
    const int column = static_cast<int>(u), row = static_cast<int>(v);
    const std::int32_t tile = index_[static_cast<std::size_t>((row >> kTileShift) * columns_ + (column >> kTileShift))];
    if (tile < 0) return {};
    return {&tiles_[static_cast<std::size_t>(tile)],
            (row & (kTileCells - 1)) * kTileNodes + (column & (kTileCells - 1)), u - column, v - row};
  }

  Eigen::Vector2d low_m_{0, 0}, high_m_{0, 0};
  int columns_ = 0, rows_ = 0;  ///< of tiles
  std::vector<std::int32_t> index_;
  std::vector<Tile> tiles_;
};

inline double Ground::height_m(Sheet sheet, double x_m, double y_m) const {
  const Place at = place(x_m, y_m);
  if (at.tile == nullptr) return kNone_m;
  const Node* const node = at.tile->nodes.data() + at.node;
  const auto k = static_cast<std::size_t>(sheet);
  const double a = node[0].height_m[k], b = node[1].height_m[k];
  const double c = node[kTileNodes].height_m[k], d = node[kTileNodes + 1].height_m[k];
  const double low = a + at.u * (b - a);
  return low + at.v * (c + at.u * (d - c) - low);
}

}  // namespace roadvec
