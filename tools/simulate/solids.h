#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "tools/simulate/scene_world.h"

namespace roadvec {

/// Twice the area between the two; positive: b is on the left of a.
[[nodiscard]] inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Where a beam met the world.
struct Hit {
  double range_m = 0;
  double cosine = 0;  ///< of the angle between beam and surface normal
  Material material = Material::road;
  std::int32_t face = kNothing;  ///< the piece of the world's true boundaries that was met, or one of:
  static constexpr std::int32_t kNothing = -1, kGround = -2, kPole = -3, kOther = -4;
};

/// A beam from its origin along a unit vector.
struct Beam {
  Eigen::Vector3d origin_m, direction;

  [[nodiscard]] double height_m(double range_m) const { return origin_m.z() + range_m * direction.z(); }
  [[nodiscard]] Eigen::Vector2d place_m(double range_m) const {
    return origin_m.head<2>() + range_m * direction.head<2>();
  }
};

/// Noise that belongs to a place: in [0, 1), the same whenever a beam comes to that square or cube of the lattice.
[[nodiscard]] double plan_noise_at(const Eigen::Vector2d& point_m, double lattice_m);
[[nodiscard]] double noise_at(const Eigen::Vector3d& point_m, double lattice_m);

/// How much of a face a beam meets, by a pattern that stands still.
enum class Pattern : std::uint8_t { solid, windows, palings };

/// An upright face between two places on the ground.
struct Face {
  Eigen::Vector2d a_m, b_m;
  double base_a_m = 0, base_b_m = 0;  ///< height of the ground below both ends
  double bottom_m = 0, top_m = 0;     ///< above the ground
  Material material = Material::wall;
  Pattern pattern = Pattern::solid;
  double along_m = 0;  ///< from where its pattern counts to a
  std::int32_t face = Hit::kOther;
};

/// An upright cylinder.
struct Pole {
  Eigen::Vector2d centre_m;
  double radius_m = 0, base_m = 0, top_m = 0;  ///< top: above the base
  Material material = Material::pole;
};

/// A box on sloping ground: its top and bottom are parallel to the ground, its sides upright.
struct Box {
  Eigen::Vector2d centre_m, axis{1, 0};  ///< axis: a unit vector along its length
  double half_length_m = 0, half_width_m = 0;
  double base_m = 0;               ///< height of the ground below the centre
  Eigen::Vector2d gradient{0, 0};  ///< of that ground
  double bottom_m = 0, top_m = 0;  ///< above the ground
  double porous_m = 0;             ///< beams end up to so deep inside, by the place they come in
  Material side = Material::car, roof = Material::car;
  std::array<std::int32_t, 4> faces{Hit::kOther, Hit::kOther, Hit::kOther, Hit::kOther};  ///< back, front, right, left
};

/// True only if no beam that stays within `stray_m` of this one can meet the thing: seen from above, it lies aside.
[[nodiscard]] inline bool passes_by(const Face& face, const Beam& beam, double stray_m) {
  const Eigen::Vector2d step = beam.direction.head<2>();
  const double left_a = cross(step, face.a_m - beam.origin_m.head<2>());
  const double left_b = cross(step, face.b_m - beam.origin_m.head<2>());
  return std::min(left_a, left_b) > stray_m || std::max(left_a, left_b) < -stray_m;
}
[[nodiscard]] inline bool passes_by(const Pole& pole, const Beam& beam, double stray_m) {
  return std::abs(cross(beam.direction.head<2>(), pole.centre_m - beam.origin_m.head<2>())) > pole.radius_m + stray_m;
}
[[nodiscard]] inline bool passes_by(const Box& box, const Beam& beam, double stray_m) {
  const Eigen::Vector2d step = beam.direction.head<2>();
  const double reach_m =
      box.half_length_m * std::abs(cross(box.axis, step)) + box.half_width_m * std::abs(step.dot(box.axis));
  return std::abs(cross(step, beam.origin_m.head<2>() - box.centre_m)) > reach_m + stray_m;
}

/// Sets `hit` if the beam meets the thing at a range in [from, to).
bool meet(const Face& face, const Beam& beam, double from_m, double to_m, Hit& hit);
bool meet(const Pole& pole, const Beam& beam, double from_m, double to_m, Hit& hit);
bool meet(const Box& box, const Beam& beam, double from_m, double to_m, Hit& hit);

}  // namespace roadvec
