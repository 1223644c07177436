#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "tools/simulate/ground.h"
#include "tools/simulate/solids.h"

namespace roadvec {

/// A piece of the road's edge, as beams meet it: where they cross it they change sheets, or end on the kerb's face.
struct Kerb {
  Eigen::Vector2d a_m, b_m;
  double foot_a_m = 0, foot_b_m = 0;  ///< height of the road's surface at both ends
  double top_a_m = 0, top_b_m = 0;    ///< height of the ground beside it
  double round_m = 0;
  std::int32_t face = Hit::kOther;
};

/// Everything that stands still.
struct Things {
  std::vector<Kerb> kerbs;
  std::vector<Face> faces;
  std::vector<Pole> poles;
  std::vector<Box> boxes;
};

/// The world without what moves: two sheets of ground, the road's edges between them, and what stands on them.
///
/// All of it lies in a uniform grid that beams walk cell by cell [AmanatidesWoo1987], and blocks of cells before that.
/// Each knows its highest point, so that most cost a beam one comparison; the sheets are looked at only where it comes
/// down to them.
class Scenery {
 public:
  /// Fails where too many edges crowd one cell, naming the place.
  [[nodiscard]] static Expected<Scenery> build(Ground ground, Things things,
                                               const double (&roughness_m)[kMaterialCount]);

  [[nodiscard]] Hit cast(const Beam& beam, double range_m) const;
  [[nodiscard]] bool on_road(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] double height_at(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] const Ground& ground() const { return ground_; }
  [[nodiscard]] const Things& things() const { return things_; }

 private:
  struct Line;
  struct Walk;
  struct Crossing;
  /// The highest of all there is in a cell, and of its ground.
  struct Level {
    float top_m = 0, ground_m = 0;
  };
  struct Cell {
    std::uint32_t first = 0, solid = 0, last = 0;  ///< in items_: kerbs, then the rest
    std::array<float, 4> corners_m{};              ///< the ground's, if it is even
    bool on_road = false;                          ///< at its middle; everywhere, if no edge crosses it
    bool even = false;                             ///< its corners give its ground, and no edge crosses it
  };
  enum class Kind : std::uint32_t { kerb, face, pole, box };
  static constexpr double kCell_m = 2.0;
  static constexpr int kBlockCells = 8, kCellsOfBlock = kBlockCells * kBlockCells;
  static constexpr std::size_t kMostKerbs = 64;
  static constexpr int kKindShift = 30;

  Scenery(Ground ground, Things things) : ground_(std::move(ground)), things_(std::move(things)) {}
  struct Builder;

  void meet_block(const Line& line, const Walk& block, const Beam& beam, double to_m, Hit& hit) const;
  void meet_solids(const Cell& cell, const Beam& beam, double from_m, double to_m, Hit& hit) const;
  [[nodiscard]] std::size_t crossings_in(const Cell& cell, const Beam& beam, double from_m, double to_m,
                                         Crossing* crossings) const;
  bool meet_kerb(const Crossing& crossing, const Beam& beam, bool& over_road, Hit& hit) const;
  bool meet_low(const Cell& cell, const Beam& beam, double from_m, double to_m, bool& over_road, Hit& hit) const;
  void meet_even(const Cell& cell, const Eigen::Vector2d& corner_m, const Beam& beam,
                 const std::array<double, 2>& range_m, Hit& hit) const;
  bool meet_ground(Sheet sheet, const Beam& beam, double from_m, double to_m, Hit& hit) const;
  void settle(Sheet sheet, const Eigen::Vector2d& gradient, const Beam& beam, double from_m, double range_m,
              Hit& hit) const;
  [[nodiscard]] std::size_t cell_index(int column, int row) const {
    const int block = row / kBlockCells * columns_ + column / kBlockCells;
    return static_cast<std::size_t>(block * kCellsOfBlock + row % kBlockCells * kBlockCells + column % kBlockCells);
  }
  [[nodiscard]] Eigen::Vector2d cell_corner_m(std::size_t index) const;

  Ground ground_;
  Things things_;
  std::array<double, kMaterialCount> roughness_m_{};
  std::vector<float> block_tops_m_;
  std::vector<Level> levels_;  ///< by cell, block after block: what most beams look at and no more
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> items_;  ///< Kind above kKindShift, index below
  Eigen::Vector2d corner_m_{0, 0};
  int columns_ = 1, rows_ = 1;  ///< of blocks
};

}  // namespace roadvec
