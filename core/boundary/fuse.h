#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/boundary/virtual_scan.h"
#include "core/boundary/window.h"
#include "core/geometry/pose2.h"

namespace roadvec {

struct FuseConfig {
  double hit_log_odds = 0.85;      ///< p = 0.70: the usual inverse sensor model of an occupancy grid
  double miss_log_odds = 0.40;     ///< p = 0.40: weaker, because a ring may pass a kerb on the road's side of its cell
  double limit_log_odds = 3.5;     ///< p = 0.97: what is gone is forgotten after nine sweeps
  double occupied_log_odds = 1.2;  ///< two hits in a row
  int average_count = 40;  ///< sweeps whose positions are averaged: 4 s at 10 Hz, about the time a cell is in good view
};
template <class Visitor>
void visit_fields(FuseConfig& c, Visitor&& field) {
  field("fuse.hit_log_odds", c.hit_log_odds, 0.05, 5.0, "log-odds that a hit adds to a cell");
  field("fuse.miss_log_odds", c.miss_log_odds, 0.0, 5.0, "log-odds that a miss takes from a cell");
  field("fuse.limit_log_odds", c.limit_log_odds, 0.5, 20.0, "log-odds are kept within plus and minus this");
  field("fuse.occupied_log_odds", c.occupied_log_odds, 0.1, 20.0, "log-odds from which a cell is part of a boundary");
  field("fuse.average_count", c.average_count, 1, 1000, "sweeps over which a cell's position is averaged");
}

/// What clears a cell: a boundary that is low can only be missed where the sweep had returns on the ground, tall
/// structure wherever a ray passes.
enum class FreeSpace : std::uint8_t { where_seen, where_passed };

/// Step 3, fuse: log-odds of the boundary in a local grid map over many sweeps [He2018, III-A-3].
///
/// The grid rolls with the vehicle by whole cells of a lattice fixed in the odom frame: no resampling, no blur. Each
/// cell keeps the mean position of the boundary in it, so that lines are finer than cells. Free space clears what
/// moved. Differs from the paper: a low cell is only cleared by a sweep that had returns in it, because rings lie
/// metres apart behind the vehicle and would erase every kerb that was mapped well from nearby; and beside a kerb's
/// edge its top is no boundary: what was taken for one from afar, a cell too far out, is forgotten. No allocation.
class LocalGrid {
 public:
  LocalGrid(const FuseConfig& config, const WindowConfig& window, FreeSpace free_space);

  /// Adds one sweep: hits where the scan says, moved by `correction` (odom to odom: what matching found after the scan
  /// was made), misses along the rays. `seen`: per cell of the scan's window, 1 where the sweep had returns.
  void fuse(const VirtualScan& scan, const VirtualScanner& scanner, std::span<const std::uint8_t> seen,
            const Pose2& correction) noexcept;
  /// The boundary cells now. Valid until the next call.
  const CellMap& cells() noexcept;

 private:
  struct Cell {
    float x_m = 0, y_m = 0;  // mean position, from the cell's corner
    float ground_m = 0, height_m = 0;
    float m2_m2 = 0;  // mean squared distance from the mean position
    std::uint32_t hit_count = 0;
    bool edge_seen = false;     // in one hit at least; positions from before are forgotten
    std::uint32_t touched = 0;  // number of the last sweep that changed the cell
  };
  void roll_to(const Window& window) noexcept;
  void clear_row(std::int64_t iy) noexcept;
  void clear_column(std::int64_t ix) noexcept;
  void hit(const BoundaryCell& cell, const Pose2& correction) noexcept;
  void average(Cell& mean, const BoundaryCell& cell, const Eigen::Vector2d& p_odom, std::int64_t ix,
               std::int64_t iy) const noexcept;
  [[nodiscard]] bool lies_beside_edge(std::int64_t ix, std::int64_t iy) const noexcept;
  void forget_tops_beside(std::int64_t ix, std::int64_t iy) noexcept;
  void miss(std::size_t place) noexcept;
  void set_log_odds(std::size_t place, float log_odds) noexcept;
  void report_cell(std::size_t place) noexcept;
  [[nodiscard]] std::size_t place_of(std::int64_t ix, std::int64_t iy) const noexcept;

  FuseConfig config_;
  FreeSpace free_space_;
  Window window_;
  std::int64_t size_;  // power of two, at least the window's: the grid is a torus
  bool started_ = false;
  std::uint32_t sweep_ = 0;
  std::vector<float> log_odds_;
  std::vector<Cell> cells_;
  std::vector<std::uint64_t> occupied_bits_;  // one per place: log-odds at or above occupied_log_odds
  std::vector<std::uint64_t> free_bits_;      // log-odds at their lower limit: another miss changes nothing
  std::vector<std::uint32_t> hit_slots_;      // per slot of the scan: last sweep in which it was hit
  CellMap occupied_;
};

}  // namespace roadvec
