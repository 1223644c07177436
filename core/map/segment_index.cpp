#include "core/map/segment_index.h"

#include <algorithm>
#include <cmath>

#include "core/base/square.h"

namespace roadvec {
namespace {

// Bounds the grid's memory when lines lie far apart: beyond it the cells grow instead.
constexpr double kMostCells = 1 << 16;
constexpr double kShortestSegment_m = 1e-6;
constexpr std::size_t kItemReserve = 8192;  // a local map has some hundred, a sweep's lines a thousand

/// Cell number of a coordinate, -1 below the grid and cell_count above it. (A cast truncates; std::floor is a call.)
int cell_of(double offset_m, double cells_per_m, int cell_count) {
  return static_cast<int>(std::clamp(offset_m * cells_per_m + 1.0, 0.0, cell_count + 1.0)) - 1;
}

}  // namespace

SegmentIndex::SegmentIndex(double cell_m) : wanted_cell_m_(cell_m) {
  items_.reserve(kItemReserve);
  hot_.reserve(kItemReserve);
  begin_.reserve(kItemReserve);
  entries_.reserve(4 * kItemReserve);
}

void SegmentIndex::build(const LineSet& lines) noexcept {
  collect_items(lines);
  lay_out_grid();
  // Counting sort of the items into cells: count, sum up, place.
  begin_.assign(static_cast<std::size_t>(column_count_) * static_cast<std::size_t>(row_count_) + 1, 0);
  for (const Item& item : items_) visit_cells(item, [&](std::size_t cell) { ++begin_[cell + 1]; });
  for (std::size_t cell = 1; cell < begin_.size(); ++cell) begin_[cell] += begin_[cell - 1];
  entries_.resize(begin_.back());
  for (std::uint32_t i = 0; i < items_.size(); ++i) {
    visit_cells(items_[i], [&](std::size_t cell) { entries_[begin_[cell]++] = i; });
  }
  for (std::size_t cell = begin_.size() - 1; cell > 0; --cell) begin_[cell] = begin_[cell - 1];
  begin_[0] = 0;
}

void SegmentIndex::collect_items(const LineSet& lines) noexcept {
  items_.clear();
  hot_.clear();
  for (std::uint32_t l = 0; l < lines.lines().size(); ++l) {
    const std::span<const Vertex> vertices = lines.vertices_of(lines.lines()[l]);
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      const Vertex& a = vertices[i - 1];
      const Vertex& b = vertices[i];
      const Eigen::Vector2d step = b.position() - a.position();
      const double length_m = step.norm();
      if (length_m < kShortestSegment_m) continue;
      items_.push_back({a.position(), step / length_m, length_m, square(a.sigma_across_m), square(b.sigma_across_m),
                        i == 1, i + 1 == vertices.size(), l});
      hot_.push_back({a.position(), step / length_m, length_m});
    }
  }
}

void SegmentIndex::lay_out_grid() noexcept {
  cell_m_ = wanted_cell_m_;
  column_count_ = row_count_ = 0;
  if (items_.empty()) return;
  Eigen::Vector2d low = items_.front().a, high = low;
  for (const Item& item : items_) {
    const Eigen::Vector2d b = item.a + item.length_m * item.direction;
    low = low.cwiseMin(item.a).cwiseMin(b);
    high = high.cwiseMax(item.a).cwiseMax(b);
  }
  const Eigen::Vector2d size = high - low;
  while ((size.x() / cell_m_ + 1) * (size.y() / cell_m_ + 1) > kMostCells) cell_m_ *= 2;
  origin_ = low;
  cells_per_m_ = 1.0 / cell_m_;
  column_count_ = static_cast<int>(size.x() * cells_per_m_) + 1;
  row_count_ = static_cast<int>(size.y() * cells_per_m_) + 1;
}

/// Cells that the segment crosses: column by column, the rows between where it enters and where it leaves.
template <class Visit>
void SegmentIndex::visit_cells(const Item& item, Visit&& visit) const {
  const Eigen::Vector2d b = item.a + item.length_m * item.direction;
  const bool rightwards = item.a.x() <= b.x();
  const Eigen::Vector2d& left = rightwards ? item.a : b;
  const Eigen::Vector2d& right = rightwards ? b : item.a;
  const double width_m = right.x() - left.x();
  const double slope = width_m > 0 ? (right.y() - left.y()) / width_m : 0.0;
  const auto column_of = [&](double x_m) { return cell_of(x_m - origin_.x(), cells_per_m_, column_count_); };
  const auto row_of = [&](double y_m) { return cell_of(y_m - origin_.y(), cells_per_m_, row_count_); };
  const int first_column = std::max(0, column_of(left.x())),
            last_column = std::min(column_count_ - 1, column_of(right.x()));
  for (int column = first_column; column <= last_column; ++column) {
    const double from_m = origin_.x() + column * cell_m_;
    double enter_m = column == first_column ? left.y() : left.y() + slope * (from_m - left.x());
    double leave_m = column == last_column ? right.y() : left.y() + slope * (from_m + cell_m_ - left.x());
    if (enter_m > leave_m) std::swap(enter_m, leave_m);
    const int last_row = std::min(row_count_ - 1, row_of(leave_m));
    for (int row = std::max(0, row_of(enter_m)); row <= last_row; ++row) {
      visit(static_cast<std::size_t>(row) * static_cast<std::size_t>(column_count_) + static_cast<std::size_t>(column));
    }
  }
}

std::optional<SegmentIndex::Hit> SegmentIndex::nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                                                       const Gate& gate) const noexcept {
  const Eigen::Vector2d from_origin = point - origin_;
  const int first_column = std::max(0, cell_of(from_origin.x() - gate.distance_m, cells_per_m_, column_count_));
  const int last_column =
      std::min(column_count_ - 1, cell_of(from_origin.x() + gate.distance_m, cells_per_m_, column_count_));
  const int first_row = std::max(0, cell_of(from_origin.y() - gate.distance_m, cells_per_m_, row_count_));
  const int last_row = std::min(row_count_ - 1, cell_of(from_origin.y() + gate.distance_m, cells_per_m_, row_count_));
  if (last_column < first_column) return std::nullopt;
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t best = kNone;
  double best2_m2 = gate.distance_m * gate.distance_m, best_raw_m = 0;
  for (int row = first_row; row <= last_row; ++row) {
    // The cells of one row lie side by side in entries_.
    const std::size_t row_start = static_cast<std::size_t>(row) * static_cast<std::size_t>(column_count_);
    const std::uint32_t end = begin_[row_start + static_cast<std::size_t>(last_column) + 1];
    for (std::uint32_t e = begin_[row_start + static_cast<std::size_t>(first_column)]; e < end; ++e) {
      const Hot& item = hot_[entries_[e]];
      const double cosine = direction.x() * item.direction.x() + direction.y() * item.direction.y();
      if ((gate.directed ? cosine : std::abs(cosine)) < gate.min_cos) continue;
      const double dx = point.x() - item.a.x(), dy = point.y() - item.a.y();
      const double raw_m = dx * item.direction.x() + dy * item.direction.y();
      const double along_m = std::clamp(raw_m, 0.0, item.length_m);
      const double off_x = dx - along_m * item.direction.x(), off_y = dy - along_m * item.direction.y();
      const double d2 = off_x * off_x + off_y * off_y;
      if (d2 >= best2_m2) continue;
      best2_m2 = d2;
      best = entries_[e];
      best_raw_m = raw_m;
    }
  }
  if (best == kNone) return std::nullopt;
  const Item& item = items_[best];
  Hit hit{best, std::clamp(best_raw_m, 0.0, item.length_m), 0.0, best2_m2};
  if (item.first_of_line && best_raw_m < 0) hit.overshoot_m = -best_raw_m;
  if (item.last_of_line && best_raw_m > item.length_m) hit.overshoot_m = best_raw_m - item.length_m;
  return hit;
}

}  // namespace roadvec
