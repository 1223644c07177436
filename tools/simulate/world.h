#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// Where a beam met the world.
struct Hit {
  double range_m = 0;
  double cosine = 0;  ///< of the angle between beam and surface normal
  Material material = Material::road;
  std::int32_t face = kGround;  ///< index of the face, or one of:
  static constexpr std::int32_t kNothing = -1, kGround = -2, kPole = -3;
};

/// Vertical face from the ground up, from a to b seen from above. A rise above zero makes it the edge of raised ground
/// that lies on its left: beams that pass over the edge find the ground higher by as much.
struct Face {
  Eigen::Vector2d a_m, b_m;
  double height_m = 0;
  double rise_m = 0;
  Material material = Material::wall;
  Material top = Material::sidewalk;
};

struct Pole {
  Eigen::Vector2d centre_m;
  double radius_m = 0, height_m = 0;
  Material material = Material::pole;
};

/// A 2.5-D world: level ground, raised plateaus with vertical edges (sidewalks, parked cars), walls and poles.
///
/// Faces and poles lie in a uniform grid that beams walk cell by cell [AmanatidesWoo1987], so that a cast costs the
/// cells it crosses. Plateaus must be closed outlines; everything stands on the ground below it. Const after build().
class World {
 public:
  /// Fails where too many things crowd one cell, naming the place.
  [[nodiscard]] static Expected<World> build(std::vector<Face> faces, std::vector<Pole> poles);

  /// First surface along a beam from a place over ground of height 0 (the road). `direction` is a unit vector.
  [[nodiscard]] Hit cast(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double range_m) const;

  /// Height of the ground at a point, parked cars included.
  [[nodiscard]] double height_at(const Eigen::Vector2d& point_m) const;
  [[nodiscard]] const std::vector<Face>& faces() const { return faces_; }

 private:
  struct Beam;
  struct Crossing;
  struct Walk;
  struct Cell {
    std::uint32_t first = 0, last = 0;  ///< in items_
  };
  static constexpr double kCell_m = 2.0;
  static constexpr std::size_t kMostInCell = 64;

  World() = default;
  void place_grid();
  [[nodiscard]] std::vector<std::vector<std::int32_t>> things_by_cell() const;
  [[nodiscard]] std::size_t crossings_in(const Cell& cell, const Beam& beam, double from, double to,
                                         Crossing* crossings) const;
  [[nodiscard]] bool meet(const Crossing& crossing, Beam& beam, Hit& hit) const;

  std::vector<Face> faces_;
  std::vector<Pole> poles_;
  std::vector<Cell> cells_;
  std::vector<std::int32_t> items_;  ///< a face's index, or ~index of a pole
  Eigen::Vector2d corner_m_{0, 0};
  int columns_ = 1, rows_ = 1;
};

}  // namespace roadvec
