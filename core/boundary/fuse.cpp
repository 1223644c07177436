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
      hit_slots_(window_.cell_count(), 0),
      occupied_(window) {}

std::size_t LocalGrid::place_of(std::int64_t ix, std::int64_t iy) const noexcept {
  return static_cast<std::size_t>((iy & (size_ - 1)) * size_ + (ix & (size_ - 1)));
}

void LocalGrid::clear_row(std::int64_t iy) noexcept {
  for (std::int64_t i = 0; i < size_; ++i) {
    const std::size_t place = place_of(i, iy);
    log_odds_[place] = 0;
    cells_[place] = {};
  }
}

void LocalGrid::clear_column(std::int64_t ix) noexcept {
  for (std::int64_t i = 0; i < size_; ++i) {
    const std::size_t place = place_of(ix, i);
    log_odds_[place] = 0;
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

void LocalGrid::hit(const BoundaryCell& cell, const Pose2& correction) noexcept {
  const Eigen::Vector2d p_odom = correction * (window_.origin_odom() + Eigen::Vector2d(cell.x_m, cell.y_m));
  const auto ix = static_cast<std::int64_t>(std::floor(p_odom.x() / window_.cell_m()));
  const auto iy = static_cast<std::int64_t>(std::floor(p_odom.y() / window_.cell_m()));
  const std::int64_t column = ix - window_.first_ix(), row = iy - window_.first_iy();
  if (column < 0 || row < 0 || column >= window_.size() || row >= window_.size()) return;
  const std::size_t place = place_of(ix, iy);
  Cell& mean = cells_[place];
  if (mean.touched == sweep_) return;
  mean.touched = sweep_;
  log_odds_[place] =
      std::min(log_odds_[place] + static_cast<float>(config_.hit_log_odds), static_cast<float>(config_.limit_log_odds));
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
  Cell& cell = cells_[place];
  if (cell.touched == sweep_) return;
  cell.touched = sweep_;
  float& odds = log_odds_[place];
  odds = std::max(odds - static_cast<float>(config_.miss_log_odds), -static_cast<float>(config_.limit_log_odds));
  // Seen to be free: should a boundary come back, it is another one.
  if (odds <= 0) cell.hit_count = 0;
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
             scanner.direction(k).y(), [&](int index) {
               if (scan.cells->slot(index) >= 0) return false;
               if (free_space_ == FreeSpace::where_seen && seen[static_cast<std::size_t>(index)] == 0) return true;
               miss(place_of(window.first_ix() + index % window.size(), window.first_iy() + index / window.size()));
               return true;
             });
  }
}

const CellMap& LocalGrid::cells() noexcept {
  occupied_.restart(window_);
  const auto threshold = static_cast<float>(config_.occupied_log_odds);
  for (int row = 0; row < window_.size(); ++row) {
    const std::size_t first = place_of(0, window_.first_iy() + row);
    for (int column = 0; column < window_.size(); ++column) {
      const std::size_t place = first + static_cast<std::size_t>((window_.first_ix() + column) & (size_ - 1));
      if (log_odds_[place] < threshold) continue;
      const Cell& cell = cells_[place];
      const float existence = 1.0F / (1.0F + std::exp(-log_odds_[place]));
      const float sigma_m = std::sqrt(cell.m2_m2);
      occupied_.add(window_.index(column, row), {static_cast<float>(column * window_.cell_m()) + cell.x_m,
                                                 static_cast<float>(row * window_.cell_m()) + cell.y_m, cell.ground_m,
                                                 cell.height_m, sigma_m, existence, cell.hit_count});
    }
  }
  return occupied_;
}

}  // namespace roadvec
