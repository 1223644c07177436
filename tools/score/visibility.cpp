#include "tools/score/visibility.h"

#include <cmath>
#include <map>
#include <utility>

#include "core/boundary/virtual_scan.h"

namespace roadvec {
namespace {

constexpr double kLookEvery_m = 1.0;  // along the way
constexpr double kCell_m = 0.2;
constexpr int kRays = 7200;  // 0.05 deg: no cell of a wall 5 m beside the way is stepped over

/// Samples by square of the mapping range, so that a look around finds its neighbourhood.
class Neighbourhoods {
 public:
  Neighbourhoods(const std::vector<LineSample>& samples, double edge_m) : edge_m_(edge_m) {
    for (std::size_t i = 0; i < samples.size(); ++i) squares_[square_of(samples[i].position_m)].push_back(i);
  }
  template <class Visit>
  void around(const Eigen::Vector2d& centre_m, Visit&& visit) const {
    const auto [column, row] = square_of(centre_m);
    for (int c = column - 1; c <= column + 1; ++c) {
      for (int r = row - 1; r <= row + 1; ++r) {
        const auto square = squares_.find({c, r});
        if (square == squares_.end()) continue;
        for (const std::size_t i : square->second) visit(i);
      }
    }
  }

 private:
  [[nodiscard]] std::pair<int, int> square_of(const Eigen::Vector2d& p_m) const {
    return {static_cast<int>(std::floor(p_m.x() / edge_m_)), static_cast<int>(std::floor(p_m.y() / edge_m_))};
  }
  double edge_m_;
  std::map<std::pair<int, int>, std::vector<std::size_t>> squares_;
};

}  // namespace

std::vector<bool> visible(const std::vector<LineSample>& truth, const Boundaries& boundaries, const Trajectory& way,
                          double range_m) {
  const Neighbourhoods neighbourhoods(truth, range_m);
  Window window({.cell_m = kCell_m, .range_m = range_m});
  CellMap cells({.cell_m = kCell_m, .range_m = range_m});
  VirtualScanner scanner({.ray_count = kRays});
  std::vector<bool> first_in_sight(truth.size(), false);
  std::vector<std::vector<std::size_t>> samples_of;  // by slot of `cells`
  std::optional<Eigen::Vector2d> last_m;
  for (const StampedPose& pose : way) {
    const Eigen::Vector2d eye_m = pose.T_map_vehicle.translation();
    if (last_m && (eye_m - *last_m).norm() < kLookEvery_m) continue;
    last_m = eye_m;
    window.centre_on(eye_m);
    cells.restart(window);
    samples_of.clear();
    neighbourhoods.around(eye_m, [&](std::size_t i) {
      const Eigen::Vector2d p_m = truth[i].position_m - window.origin_odom();
      const auto column = static_cast<int>(std::floor(p_m.x() / kCell_m)),
                 row = static_cast<int>(std::floor(p_m.y() / kCell_m));
      if (column < 0 || row < 0 || column >= window.size() || row >= window.size()) return;
      const int index = window.index(column, row);
      if (!cells.has(index)) {
        cells.add(index, {});
        samples_of.resize(cells.cells().size());
      }
      if (cells.has(index)) samples_of[static_cast<std::size_t>(cells.slot(index))].push_back(i);
    });
    for (const VirtualScan::Ray& ray : scanner.run(cells, eye_m).rays) {
      if (ray.slot < 0) continue;
      for (const std::size_t i : samples_of[static_cast<std::size_t>(ray.slot)]) first_in_sight[i] = true;
    }
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (boundaries.seen_within_m[truth[i].line] > range_m) first_in_sight[i] = false;
  }
  return first_in_sight;
}

}  // namespace roadvec
