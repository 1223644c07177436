#include "core/boundary/fuse.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/boundary/ray.h"

namespace roadvec {

LocalGrid::LocalGrid(const FuseConfig& config, const WindowConfig& window, FreeSpace free_space)
    : config_(config),
      free_space_(free_space),
      window_(window),
      size_(static_cast<std::int64_t>(std::bit_ceil(static_cast<std::uint64_t>(window_.size())))),
      log_odds_(static_cast<std::size_t>(size_ * size_), 0.0F),
      cells_(log_odds_.size()),
      occupied_bits_(log_odds_.size() / 64, 0),
      free_bits_(occupied_bits_.size(), 0),
      hit_slots_(window_.cell_count(), 0),
      occupied_(window) {}

std::size_t LocalGrid::place_of(std::int64_t ix, std::int64_t iy) const noexcept {
  return static_cast<std::size_t>((iy & (size_ - 1)) * size_ + (ix & (size_ - 1)));
}

void LocalGrid::set_log_odds(std::size_t place, float log_odds) noexcept {
  log_odds_[place] = log_odds;
  const auto set = [place](std::vector<std::uint64_t>& bits, bool value) {
    const std::uint64_t bit = std::uint64_t{1} << (place % 64);
    bits[place / 64] = value ? bits[place / 64] | bit : bits[place / 64] & ~bit;
  };
  set(occupied_bits_, log_odds >= static_cast<float>(config_.occupied_log_odds));
  set(free_bits_, log_odds <= -static_cast<float>(config_.limit_log_odds));
}

void LocalGrid::clear_row(std::int64_t iy) noexcept {
  for (std::int64_t i = 0; i < size_; ++i) {
    const std::size_t place = place_of(i, iy);
    set_log_odds(place, 0);
    cells_[place] = {};
  }
}

void LocalGrid::clear_column(std::int64_t ix) noexcept {
  for (std::int64_t i = 0; i < size_; ++i) {
    const std::size_t place = place_of(ix, i);
    set_log_odds(place, 0);
    cells_[place] = {};
  }
}

/// Rows and columns that leave the window are cleared, so that the torus shows nothing old where they come in again.
void LocalGrid::roll_to(const Window& window) noexcept {
  if (!started_) window_ = window;
  started_ = true;
  const std::int64_t last = window_.size() - 1;
  const std::int64_t dx = std::clamp<std::int64_t>(window.first_ix() - window_.first_ix(), -last - 1, last + 1);
  const std::int64_t dy = std::clamp<std::int64_t>(window.first_iy() - window_.first_iy(), -last - 1, last + 1);
  for (std::int64_t k = 0; k < std::abs(dx); ++k) clear_column(window_.first_ix() + (dx > 0 ? k : last - k));
  for (std::int64_t k = 0; k < std::abs(dy); ++k) clear_row(window_.first_iy() + (dy > 0 ? k : last - k));
  window_ = window;
}

bool LocalGrid::lies_beside_edge(std::int64_t ix, std::int64_t iy) const noexcept {
  for (std::int64_t y = iy - 1; y <= iy + 1; ++y) {
    for (std::int64_t x = ix - 1; x <= ix + 1; ++x) {
      const std::size_t place = place_of(x, y);
      if ((x != ix || y != iy) && cells_[place].edge_seen && (occupied_bits_[place / 64] >> (place % 64) & 1) != 0) {
        return true;
      }
    }
  }
  return false;
}

void LocalGrid::forget_tops_beside(std::int64_t ix, std::int64_t iy) noexcept {
  for (std::int64_t y = iy - 1; y <= iy + 1; ++y) {
    for (std::int64_t x = ix - 1; x <= ix + 1; ++x) {
      const std::size_t place = place_of(x, y);
      if (cells_[place].hit_count == 0 || cells_[place].edge_seen) continue;
      cells_[place].hit_count = 0;
      if (x != ix || y != iy) set_log_odds(place, 0);
    }
  }
}

void LocalGrid::hit(const BoundaryCell& cell, const Pose2& correction) noexcept {
  const Eigen::Vector2d p_odom = correction * (window_.origin_odom() + Eigen::Vector2d(cell.x_m, cell.y_m));
  const auto ix = static_cast<std::int64_t>(std::floor(p_odom.x() / window_.cell_m()));
  const auto iy = static_cast<std::int64_t>(std::floor(p_odom.y() / window_.cell_m()));
  const std::int64_t column = ix - window_.first_ix(), row = iy - window_.first_iy();
  if (column < 0 || row < 0 || column >= window_.size() || row >= window_.size()) return;
  const std::size_t place = place_of(ix, iy);
  Cell& mean = cells_[place];
  if (mean.touched == sweep_) return;
  if (cell.edge_seen) {
    forget_tops_beside(ix, iy);
    mean.edge_seen = true;
  } else if (lies_beside_edge(ix, iy)) {
    return;
  }
  mean.touched = sweep_;
  set_log_odds(place, std::min(log_odds_[place] + static_cast<float>(config_.hit_log_odds),
                               static_cast<float>(config_.limit_log_odds)));
  if (cell.edge_seen || !mean.edge_seen) average(mean, cell, p_odom, ix, iy);
}

void LocalGrid::average(Cell& mean, const BoundaryCell& cell, const Eigen::Vector2d& p_odom, std::int64_t ix,
                        std::int64_t iy) const noexcept {
  mean.hit_count += 1;
  const float share =
      1.0F / static_cast<float>(std::min(mean.hit_count, static_cast<std::uint32_t>(config_.average_count)));
  const auto dx = static_cast<float>(p_odom.x() - static_cast<double>(ix) * window_.cell_m()) - mean.x_m;
  const auto dy = static_cast<float>(p_odom.y() - static_cast<double>(iy) * window_.cell_m()) - mean.y_m;
  mean.x_m += share * dx;
  mean.y_m += share * dy;
  mean.m2_m2 += share * ((1 - share) * 0.5F * (dx * dx + dy * dy) + cell.sigma_m * cell.sigma_m - mean.m2_m2);
  mean.ground_m += share * (cell.ground_m - mean.ground_m);
  mean.height_m += share * (cell.height_m - mean.height_m);
}

void LocalGrid::miss(std::size_t place) noexcept {
  if ((free_bits_[place / 64] >> (place % 64) & 1) != 0) return;  // most: known to be free
  Cell& cell = cells_[place];
  if (cell.touched == sweep_) return;
  cell.touched = sweep_;
  set_log_odds(place, std::max(log_odds_[place] - static_cast<float>(config_.miss_log_odds),
                               -static_cast<float>(config_.limit_log_odds)));
  // Seen to be free: should a boundary come back, it is another one.
  if (log_odds_[place] <= 0) {
    cell.hit_count = 0;
    cell.edge_seen = false;
  }
}

void LocalGrid::fuse(const VirtualScan& scan, const VirtualScanner& scanner, std::span<const std::uint8_t> seen,
                     const Pose2& correction) noexcept {
  ++sweep_;
  roll_to(scan.cells->window());
  for (const VirtualScan::Ray& ray : scan.rays) {
    if (ray.slot < 0) continue;
    std::uint32_t& last_hit = hit_slots_[static_cast<std::size_t>(ray.slot)];
    if (last_hit == sweep_) continue;
    last_hit = sweep_;
    hit(scan.cells->cells()[static_cast<std::size_t>(ray.slot)], correction);
  }
  const Window& window = scan.cells->window();
  for (std::size_t k = 0; k < scan.rays.size(); ++k) {
    walk_ray(window, scan.origin_window_m.x(), scan.origin_window_m.y(), scanner.direction(k).x(),
             scanner.direction(k).y(), [&](int index, int column, int row) {
               if (scan.cells->has(index)) return false;
               if (free_space_ == FreeSpace::where_seen && seen[static_cast<std::size_t>(index)] == 0) return true;
               miss(place_of(window.first_ix() + column, window.first_iy() + row));
               return true;
             });
  }
}

const CellMap& LocalGrid::cells() noexcept {
  occupied_.restart(window_);
  for (std::size_t word = 0; word < occupied_bits_.size(); ++word) {
    for (std::uint64_t bits = occupied_bits_[word]; bits != 0; bits &= bits - 1) {
      report_cell(64 * word + static_cast<std::size_t>(std::countr_zero(bits)));
    }
  }
  return occupied_;
}

void LocalGrid::report_cell(std::size_t place) noexcept {
  const auto x = static_cast<std::int64_t>(place) & (size_ - 1), y = static_cast<std::int64_t>(place) / size_;
  const auto column = static_cast<int>((x - window_.first_ix()) & (size_ - 1));
  const auto row = static_cast<int>((y - window_.first_iy()) & (size_ - 1));
  if (column >= window_.size() || row >= window_.size()) return;
  const Cell& cell = cells_[place];
  const float existence = 1.0F / (1.0F + std::exp(-log_odds_[place]));
  occupied_.add(window_.index(column, row), {static_cast<float>(column * window_.cell_m()) + cell.x_m,
                                             static_cast<float>(row * window_.cell_m()) + cell.y_m, cell.ground_m,
                                             cell.height_m, std::sqrt(cell.m2_m2), existence, cell.hit_count});
}

}  // namespace roadvec
