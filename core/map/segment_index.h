#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/geometry/line_set.h"

namespace roadvec {

inline constexpr double kIndexCell_m = 2.0;  ///< suits lines of a street: a few segments in each

/// The segments of a LineSet in a uniform grid of buckets: answers "which segment lies nearest" by looking only around
/// a point.
///
/// Any metric frame. Build O(cells + segments), query O(segments in the cells that the gate touches). No allocation
/// once warm.
class SegmentIndex {
 public:
  struct Item {
    Eigen::Vector2d a, direction;  ///< first point, unit direction
    double length_m = 0;
    double variance_a_m2 = 0, variance_b_m2 = 0;  ///< across, at first and last point
    bool first_of_line = false, last_of_line = false;
    std::uint32_t line = 0;  ///< index in the LineSet

    [[nodiscard]] Eigen::Vector2d normal() const { return {-direction.y(), direction.x()}; }
    [[nodiscard]] double variance_at(double along_m) const {
      return variance_a_m2 + (variance_b_m2 - variance_a_m2) * along_m / length_m;
    }
  };
  struct Gate {
    double distance_m = 0;
    double min_cos = -1;   ///< of the angle between the query's direction and the segment's
    bool directed = true;  ///< false: a segment may also run the other way
  };
  struct Hit {
    std::uint32_t item = 0;
    double along_m = 0;      ///< foot of the point, kept within the segment
    double overshoot_m = 0;  ///< how far the foot would lie beyond the end of the whole polyline; 0 within it
    double distance2_m2 = 0;
  };

  explicit SegmentIndex(double cell_m);
  void build(const LineSet& lines) noexcept;
  [[nodiscard]] std::optional<Hit> nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                                           const Gate& gate) const noexcept;
  [[nodiscard]] const std::vector<Item>& items() const { return items_; }

 private:
  struct CellRange {
    int first = 0, last = -1;
  };
  /// What a query reads of an item, packed: the search is bound by memory.
  struct Hot {
    Eigen::Vector2d a, direction;
    double length_m;
  };
  void collect_items(const LineSet& lines) noexcept;
  void lay_out_grid() noexcept;
  template <class Visit>
  void visit_cells(const Item& item, Visit&& visit) const;

  double wanted_cell_m_, cell_m_ = 1, cells_per_m_ = 1;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  int column_count_ = 0, row_count_ = 0;
  std::vector<Item> items_;
  std::vector<std::uint32_t> begin_;    ///< per cell, into entries_; one more than cells
  std::vector<std::uint32_t> entries_;  ///< item numbers, cell by cell
  std::vector<Hot> hot_;                ///< one per item
};

}  // namespace roadvec
