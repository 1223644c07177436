#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

namespace roadvec {

struct WindowConfig {
  double cell_m = 0.2;    ///< [He2018, IV-A]
  double range_m = 40.0;  ///< half of the paper's 80 m [He2018, IV-A]
};
template <class Visitor>
void visit_fields(WindowConfig& c, Visitor&& field) {
  field("window.cell_m", c.cell_m, 0.05, 1.0, "edge of a grid cell");
  field("window.range_m", c.range_m, 10.0, 100.0, "half the edge of the square window of cells around the vehicle");
}

/// The square of cells around the vehicle. Cells belong to one lattice that is fixed in the odom frame, so the window
/// moves by whole cells and nothing is ever resampled.
///
/// Differs from the paper: its grid of 401 x 151 cells moves and turns with the vehicle; ours is square and does not
/// turn, because turning a grid blurs it and side streets lie across the paper's narrow side.
class Window {
 public:
  explicit Window(const WindowConfig& config)
      : cell_m_(config.cell_m), half_(static_cast<int>(std::lround(config.range_m / config.cell_m))) {}

  void centre_on(const Eigen::Vector2d& p_odom) {
    ix_ = static_cast<std::int64_t>(std::floor(p_odom.x() / cell_m_));
    iy_ = static_cast<std::int64_t>(std::floor(p_odom.y() / cell_m_));
  }
  [[nodiscard]] int size() const { return 2 * half_ + 1; }
  [[nodiscard]] int half() const { return half_; }
  [[nodiscard]] double cell_m() const { return cell_m_; }
  [[nodiscard]] std::size_t cell_count() const {
    return static_cast<std::size_t>(size()) * static_cast<std::size_t>(size());
  }
  /// Lattice index of the window's first column and row.
  [[nodiscard]] std::int64_t first_ix() const { return ix_ - half_; }
  [[nodiscard]] std::int64_t first_iy() const { return iy_ - half_; }
  /// Corner of the window's first cell: window coordinates are odom coordinates minus this, small enough for floats.
  [[nodiscard]] Eigen::Vector2d origin_odom() const {
    return {static_cast<double>(first_ix()) * cell_m_, static_cast<double>(first_iy()) * cell_m_};
  }
  [[nodiscard]] int index(int column, int row) const { return row * size() + column; }
  friend bool operator==(const Window&, const Window&) = default;

 private:
  double cell_m_;
  int half_;
  std::int64_t ix_ = 0, iy_ = 0;
};

/// A cell that holds part of a boundary, with where in the cell it is.
struct BoundaryCell {
  float x_m = 0, y_m = 0;   ///< window coordinates: mean of what was measured, not the cell's centre
  float ground_m = 0;       ///< height of the road beside it
  float height_m = 0;       ///< of the boundary above that
  float sigma_m = 0;        ///< spread of the positions measured
  float existence = 0;      ///< 0..1
  std::uint32_t count = 0;  ///< returns (one sweep) or sweeps (local grid)
  bool edge_seen = true;    ///< false: only the top of something low, up to a ring's distance behind its face
};

/// Boundary cells of a window: a list, and for each cell of the window its place in that list, or -1. Whether there is
/// one is also kept as a bit: rays ask that of thousands of cells, and 20 kB of bits stay in the first-level cache.
class CellMap {
 public:
  explicit CellMap(const WindowConfig& config)
      : window_(config), slot_(window_.cell_count(), -1), bits_(window_.cell_count() / 64 + 1, 0) {
    cells_.reserve(window_.cell_count() / 4);
    index_.reserve(window_.cell_count() / 4);
  }
  void restart(const Window& window) {
    for (const int i : index_) {
      slot_[static_cast<std::size_t>(i)] = -1;
      bits_[static_cast<std::size_t>(i) / 64] = 0;
    }
    window_ = window;
    cells_.clear();
    index_.clear();
  }
  /// Adds a cell; never more than a quarter of the window, the rest is dropped.
  void add(int index, const BoundaryCell& cell) {
    if (cells_.size() == cells_.capacity()) return;
    slot_[static_cast<std::size_t>(index)] = static_cast<std::int32_t>(cells_.size());
    bits_[static_cast<std::size_t>(index) / 64] |= std::uint64_t{1} << (static_cast<std::size_t>(index) % 64);
    index_.push_back(index);
    cells_.push_back(cell);
  }
  [[nodiscard]] const Window& window() const { return window_; }
  [[nodiscard]] std::int32_t slot(int index) const { return slot_[static_cast<std::size_t>(index)]; }
  [[nodiscard]] bool has(int index) const {
    return (bits_[static_cast<std::size_t>(index) / 64] >> (static_cast<std::size_t>(index) % 64) & 1) != 0;
  }
  [[nodiscard]] const std::vector<BoundaryCell>& cells() const { return cells_; }
  [[nodiscard]] int index_of(std::size_t slot) const { return index_[slot]; }

 private:
  Window window_;
  std::vector<std::int32_t> slot_;
  std::vector<std::uint64_t> bits_;
  std::vector<BoundaryCell> cells_;
  std::vector<int> index_;
};

}  // namespace roadvec
