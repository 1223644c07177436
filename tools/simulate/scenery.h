#pragma once

#include <array>
#include <cstdint>
#include <span>
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
/// down to them. Cells also list what is within kStray_m of them: beams that leave side by side take one walk.
class Scenery {
 public:
  /// Fails where too many edges crowd one cell, naming the place.
  [[nodiscard]] static Expected<Scenery> build(Ground ground, Things things,
                                               const double (&roughness_m)[kMaterialCount]);

  /// How far a beam may be from the first one of its cast.
  static constexpr double kStray_m = 0.2;

  static constexpr std::size_t kMostBeams = 3;  ///< of a cast
  /// The first surface of each beam from a range on and before that of its hit, which stays if there is none.
  void cast(std::span<const Beam> beams, double from_m, std::span<Hit> hits) const;
  [[nodiscard]] bool on_road(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] double height_at(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] const Ground& ground() const { return ground_; }
  [[nodiscard]] const Things& things() const { return things_; }

 private:
  struct Line;
  struct Walk;
  struct Cast;
  struct Crossing;
  struct Footing;
  /// The highest of all there is in a cell, and of its ground.
  struct Level {
    float top_m = 0, ground_m = 0;
  };
  /// One sheet of the ground in a cell.
  struct Patch {
    std::array<float, 4> corners_m{};
    bool even = false;     ///< its corners tell all of it
    bool uniform = false;  ///< one material
    Material material = Material::road;
  };
  struct Cell {
    std::uint32_t first = 0, solid = 0, last = 0;  ///< in items_: kerbs, then the rest
    std::array<Patch, 2> patches;                  ///< by Sheet
    bool on_road = false;                          ///< at its middle; everywhere, if no edge crosses it
  };
  /// A cell's square, and where a beam is in it.
  struct Stretch {
    const Cell& cell;
    Eigen::Vector2d corner_m;
    double from_m, to_m;
  };
  enum class Kind : std::uint32_t { kerb, face, pole, box };
  static constexpr double kCell_m = 2.0;
  static constexpr int kBlockCells = 8, kCellsOfBlock = kBlockCells * kBlockCells;
  static constexpr std::size_t kMostKerbs = 64;
  static constexpr int kKindShift = 30;

  Scenery(Ground ground, Things things) : ground_(std::move(ground)), things_(std::move(things)) {}
  struct Builder;

  void meet_block(const Line& line, const Walk& block, double to_m, Cast& cast) const;
  void meet_solids(const Cell& cell, Cast& cast) const;
  void meet_low(const Stretch& stretch, float ground_m, Cast& cast) const;
  [[nodiscard]] std::size_t crossings_in(const Stretch& stretch, const Beam& beam, Crossing* crossings) const;
  void meet_edges(Stretch stretch, const Beam& beam, bool& over_road, Hit& hit) const;
  bool meet_kerb(const Crossing& crossing, const Beam& beam, bool& over_road, Hit& hit) const;
  bool meet_sheet(Sheet sheet, const Stretch& stretch, const Beam& beam, Footing& footing, Hit& hit) const;
  [[nodiscard]] bool find_even(const Patch& patch, const Stretch& stretch, const Beam& beam, Footing& footing) const;
  [[nodiscard]] bool find_uneven(Sheet sheet, const Stretch& stretch, const Beam& beam, Footing& footing) const;
  [[nodiscard]] bool find_beside(const Footing& middle, Sheet sheet, const Stretch& stretch, const Beam& beam,
                                 double& range_m) const;
  void settle(const Patch& patch, const Beam& beam, double from_m, Footing& footing, Hit& hit) const;
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
