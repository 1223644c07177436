#include "tools/simulate/ground.h"

#include <algorithm>

namespace roadvec {
namespace {

/// Behind the kerb the ground rises for so far, then it comes to the height that all land has far from roads.
constexpr double kRises_m = 4;
/// Samples lie off the round coordinates that people give roads, so that hardly any lies on a road's edge.
const Eigen::Vector2d kOffRound_m(-0.1371, -0.0913);

double rise_m(const RoadEdge& edge, double share, double off_m, double far_rise_m) {
  const double own_m = std::lerp(edge.kerb_a_m, edge.kerb_b_m, share) + edge.slope * std::min(off_m, kRises_m);
  return std::lerp(own_m, far_rise_m, std::clamp(off_m / kRises_m - 1, 0.0, 1.0));
}

}  // namespace

/// Finds the nearest edge of every node by spreading each edge over the nodes within reach.
struct Ground::Builder {
  Ground& ground;
  const std::vector<RoadEdge>& edges;
  double far_rise_m;
  Material far;

  void place_tiles() {
    const double width_m = kTileCells * kStep_m;
    Eigen::Vector2d low = edges.front().a_m, high = low;
    for (const RoadEdge& edge : edges) {
      low = low.cwiseMin(edge.a_m);
      high = high.cwiseMax(edge.a_m);
    }
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(kMargin_m);
    ground.low_m_ = ((low - margin) / width_m).array().floor().matrix() * width_m + kOffRound_m;
    ground.columns_ = static_cast<int>(std::ceil((high.x() + kMargin_m - ground.low_m_.x()) / width_m));
    ground.rows_ = static_cast<int>(std::ceil((high.y() + kMargin_m - ground.low_m_.y()) / width_m));
    ground.high_m_ = ground.low_m_ + width_m * Eigen::Vector2d(ground.columns_, ground.rows_);
    ground.index_.assign(static_cast<std::size_t>(ground.columns_ * ground.rows_), -1);
    std::int32_t count = 0;
    for (const RoadEdge& edge : edges) {
      const Eigen::Vector2d from = (edge.a_m - margin - ground.low_m_) / width_m;
      const Eigen::Vector2d to = (edge.a_m + margin - ground.low_m_) / width_m;
      for (int y = static_cast<int>(from.y()); y <= std::min(static_cast<int>(to.y()), ground.rows_ - 1); ++y) {
        for (int x = static_cast<int>(from.x()); x <= std::min(static_cast<int>(to.x()), ground.columns_ - 1); ++x) {
          std::int32_t& tile = ground.index_[static_cast<std::size_t>(y * ground.columns_ + x)];
          if (tile < 0) tile = count++;
        }
      }
    }
    ground.tiles_.resize(static_cast<std::size_t>(count));
  }

  /// Edges that reach each tile's nodes.
  [[nodiscard]] std::vector<std::vector<std::uint32_t>> edges_by_tile() const {
    std::vector<std::vector<std::uint32_t>> by_tile(ground.tiles_.size());
    const double width_m = kTileCells * kStep_m;
    for (std::uint32_t i = 0; i < edges.size(); ++i) {
      const Eigen::Vector2d reach = Eigen::Vector2d::Constant(kReach_m + 1);
      const Eigen::Vector2d from = (edges[i].a_m - reach - ground.low_m_) / width_m;
      const Eigen::Vector2d to = (edges[i].a_m + reach - ground.low_m_) / width_m;
      for (int y = static_cast<int>(from.y()); y <= static_cast<int>(to.y()); ++y) {
        for (int x = static_cast<int>(from.x()); x <= static_cast<int>(to.x()); ++x) {
          by_tile[static_cast<std::size_t>(ground.index_[static_cast<std::size_t>(y * ground.columns_ + x)])].push_back(
              i);
        }
      }
    }
    return by_tile;
  }

  /// By node row, where the road's outline crosses it: between an odd crossing and the next even one lies the road.
  [[nodiscard]] std::vector<std::vector<double>> crossings_by_row() const {
    std::vector<std::vector<double>> rows(static_cast<std::size_t>(ground.rows_ * kTileCells + 1));
    for (const RoadEdge& edge : edges) {
      const double a = (edge.a_m.y() - ground.low_m_.y()) / kStep_m, b = (edge.b_m.y() - ground.low_m_.y()) / kStep_m;
      for (double y = std::ceil(std::min(a, b)); y < std::max(a, b); ++y) {
        rows[static_cast<std::size_t>(y)].push_back(std::lerp(edge.a_m.x(), edge.b_m.x(), (y - a) / (b - a)));
      }
    }
    for (auto& row : rows) std::sort(row.begin(), row.end());
    return rows;
  }

  struct Nearest {
    double distance2_m2 = kReach_m * kReach_m;
    std::int32_t edge = -1;
    double share = 0;
  };

  [[nodiscard]] std::vector<Nearest> nearest_edges(const std::vector<std::uint32_t>& near,
                                                   const Eigen::Vector2d& corner_m) const {
    std::vector<Nearest> nearest(kTileNodes * kTileNodes);
    for (const std::uint32_t i : near) {
      const RoadEdge& edge = edges[i];
      const Eigen::Vector2d leg = edge.b_m - edge.a_m, reach = Eigen::Vector2d::Constant(kReach_m);
      const Eigen::Vector2d from = (edge.a_m.cwiseMin(edge.b_m) - reach - corner_m) / kStep_m;
      const Eigen::Vector2d to = (edge.a_m.cwiseMax(edge.b_m) + reach - corner_m) / kStep_m;
      const int first_x = std::max(0, static_cast<int>(std::ceil(from.x())));
      const int last_x = std::min(kTileCells, static_cast<int>(std::floor(to.x())));
      for (int y = std::max(0, static_cast<int>(std::ceil(from.y())));
           y <= std::min(kTileCells, static_cast<int>(std::floor(to.y()))); ++y) {
        for (int x = first_x; x <= last_x; ++x) {
          const Eigen::Vector2d offset = corner_m + kStep_m * Eigen::Vector2d(x, y) - edge.a_m;
          const double share = std::clamp(offset.dot(leg) / leg.squaredNorm(), 0.0, 1.0);
          const double distance2_m2 = (offset - share * leg).squaredNorm();
          Nearest& node = nearest[static_cast<std::size_t>(y * kTileNodes + x)];
          if (distance2_m2 < node.distance2_m2) node = {distance2_m2, static_cast<std::int32_t>(i), share};
        }
      }
    }
    return nearest;
  }

  void fill(Node& node, Material& material, const Nearest& nearest, bool on_road, double land_m) const {
    const double off_m = (on_road ? -1 : 1) * std::sqrt(nearest.distance2_m2);
    node.off_road_m = static_cast<float>(off_m);
    material = far;
    if (nearest.edge < 0) {
      node.height_m[0] = static_cast<float>(land_m);
      node.height_m[1] = static_cast<float>(land_m + far_rise_m);
      return;
    }
    const RoadEdge& edge = edges[static_cast<std::size_t>(nearest.edge)];
    node.height_m[0] = static_cast<float>(land_m + edge.crown * std::min(-off_m, edge.crest_m));
    node.height_m[1] = static_cast<float>(land_m + rise_m(edge, nearest.share, off_m, far_rise_m));
    material = off_m < edge.near_m ? edge.near : edge.far;
  }
};

Ground::Ground(const Land& land, const std::vector<RoadEdge>& edges, double far_rise_m, Material far) {
  if (edges.empty()) return;
  Builder builder{*this, edges, far_rise_m, far};
  builder.place_tiles();
  const auto near = builder.edges_by_tile();
  const auto rows = builder.crossings_by_row();
  for (int i = 0; i < columns_ * rows_; ++i) {
    if (index_[static_cast<std::size_t>(i)] < 0) continue;
    const auto t = static_cast<std::size_t>(index_[static_cast<std::size_t>(i)]);
    const int column = i % columns_ * kTileCells, row = i / columns_ * kTileCells;
    const Eigen::Vector2d corner_m = low_m_ + kStep_m * Eigen::Vector2d(column, row);
    const auto nearest = builder.nearest_edges(near[t], corner_m);
    for (int y = 0; y < kTileNodes; ++y) {
      const std::vector<double>& crossings = rows[static_cast<std::size_t>(row + y)];
      for (int x = 0; x < kTileNodes; ++x) {
        const Eigen::Vector2d point_m = corner_m + kStep_m * Eigen::Vector2d(x, y);
        const auto before = std::upper_bound(crossings.begin(), crossings.end(), point_m.x()) - crossings.begin();
        const auto n = static_cast<std::size_t>(y * kTileNodes + x);
        builder.fill(tiles_[t].nodes[n], tiles_[t].materials[n], nearest[n], before % 2 == 1, land.height_m(point_m));
      }
    }
  }
}

Ground::Level Ground::level(Sheet sheet, const Eigen::Vector2d& point_m) const {
  const Place at = place(point_m.x(), point_m.y());
  if (at.tile == nullptr) return {};
  const Node* const node = at.tile->nodes.data() + at.node;
  const auto k = static_cast<std::size_t>(sheet);
  const double a = node[0].height_m[k], b = node[1].height_m[k];
  const double c = node[kTileNodes].height_m[k], d = node[kTileNodes + 1].height_m[k];
  const double low = a + at.u * (b - a);
  return {low + at.v * (c + at.u * (d - c) - low),
          Eigen::Vector2d(std::lerp(b - a, d - c, at.v), std::lerp(c - a, d - b, at.u)) / kStep_m};
}

Material Ground::material(const Eigen::Vector2d& point_m) const {
  const Place at = place(point_m.x(), point_m.y());
  if (at.tile == nullptr) return Material::grass;
  return at.tile->materials[static_cast<std::size_t>(at.node + (at.u >= 0.5 ? 1 : 0) + (at.v >= 0.5 ? kTileNodes : 0))];
}

double Ground::off_road_m(const Eigen::Vector2d& point_m) const {
  const Place at = place(point_m.x(), point_m.y());
  if (at.tile == nullptr) return kReach_m;
  const Node* const node = at.tile->nodes.data() + at.node;
  const double low = std::lerp<double>(node[0].off_road_m, node[1].off_road_m, at.u);
  return std::lerp(low, std::lerp<double>(node[kTileNodes].off_road_m, node[kTileNodes + 1].off_road_m, at.u), at.v);
}

}  // namespace roadvec
