#include "tools/simulate/solids.h"

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

double fraction(double value) { return value - std::floor(value); }

/// What a face is made of at a place on it, or nothing where the beam passes through.
bool shows(const Face& face, double along_m, double above_m, Material& material) {
  material = face.material;
  if (face.pattern == Pattern::palings) {
    constexpr double kPitch_m = 0.11, kPaling = 0.55, kRail_m = 0.07;
    return fraction(along_m / kPitch_m) < kPaling || face.top_m - above_m < kRail_m || above_m < 2 * kRail_m;
  }
  if (face.pattern == Pattern::windows) {
    constexpr double kPitch_m = 2.6, kWindow = 0.45, kStorey_m = 2.9, kSill_m = 0.9, kLintel_m = 2.2;
    const double in_storey_m = kStorey_m * fraction(above_m / kStorey_m);
    if (in_storey_m > kSill_m && in_storey_m < kLintel_m && fraction(along_m / kPitch_m) < kWindow) {
      material = Material::glass;
    }
  }
  return true;
}

std::uint64_t mixed(std::uint64_t hash, double squares) {
  // The square that it is in; what floor() does costs a call where the processor's own is not to be had.
  const auto towards_zero = static_cast<std::int64_t>(squares);
  hash ^= static_cast<std::uint64_t>(towards_zero - (static_cast<double>(towards_zero) > squares ? 1 : 0));
  hash *= 0x9E3779B97F4A7C15ULL;
  return hash ^ hash >> 32;
}

double noise_of(std::uint64_t hash) {
  hash *= 0xD6E8FEB86659FD93ULL;
  hash ^= hash >> 32;
  return static_cast<double>(hash >> 11) * 0x1p-53;
}

}  // namespace

double plan_noise_at(const Eigen::Vector2d& point_m, double lattice_m) {
  const double inverse = 1 / lattice_m;
  return noise_of(mixed(mixed(0, point_m.x() * inverse), point_m.y() * inverse));
}

double noise_at(const Eigen::Vector3d& point_m, double lattice_m) {
  const double inverse = 1 / lattice_m;
  return noise_of(mixed(mixed(mixed(0, point_m.x() * inverse), point_m.y() * inverse), point_m.z() * inverse));
}

bool meet(const Face& face, const Beam& beam, double from_m, double to_m, Hit& hit) {
  const Eigen::Vector2d offset = face.a_m - beam.origin_m.head<2>(), step = beam.direction.head<2>();
  const double left_a = cross(step, offset), left_b = cross(step, face.b_m - beam.origin_m.head<2>());
  // One of them counts as neither side, so that a beam through the joint of two faces meets one of them.
  if ((left_a < 0) == (left_b < 0)) return false;
  const Eigen::Vector2d along = face.b_m - face.a_m;
  const double across = left_b - left_a, inverse = 1 / across;
  const double range_m = cross(offset, along) * inverse, share = -left_a * inverse;
  if (!(range_m >= from_m && range_m < to_m)) return false;
  const double above_m = beam.height_m(range_m) - std::lerp(face.base_a_m, face.base_b_m, share);
  if (above_m < face.bottom_m || above_m > face.top_m) return false;
  const double length_m = along.norm();
  Material material = face.material;
  if (face.pattern != Pattern::solid && !shows(face, face.along_m + share * length_m, above_m, material)) return false;
  hit = {range_m, std::abs(across) / length_m, material, face.face};
  return true;
}

bool meet(const Pole& pole, const Beam& beam, double from_m, double to_m, Hit& hit) {
  const Eigen::Vector2d offset = pole.centre_m - beam.origin_m.head<2>(), step = beam.direction.head<2>();
  const double a = step.squaredNorm(), b = step.dot(offset);
  const double under_root = b * b - a * (offset.squaredNorm() - pole.radius_m * pole.radius_m);
  if (!(under_root > 0)) return false;
  const double range_m = (b - std::sqrt(under_root)) / a;
  if (!(range_m >= from_m && range_m < to_m) || beam.height_m(range_m) - pole.base_m > pole.top_m) return false;
  const Eigen::Vector2d normal = (beam.place_m(range_m) - pole.centre_m) / pole.radius_m;
  hit = {range_m, std::abs(normal.dot(step)), pole.material, Hit::kPole};
  return true;
}

bool meet(const Box& box, const Beam& beam, double from_m, double to_m, Hit& hit) {
  const Eigen::Vector2d offset = beam.origin_m.head<2>() - box.centre_m, step = beam.direction.head<2>();
  const double step_along = step.dot(box.axis), step_across = cross(box.axis, step);
  const double reach_m = box.half_length_m * std::abs(step_across) + box.half_width_m * std::abs(step_along);
  if (std::abs(cross(step, offset)) > reach_m) return false;
  // In the box's own axes: along it, across it, and above the ground that it stands on.
  const std::array<double, 3> at{offset.dot(box.axis), cross(box.axis, offset),
                                 beam.origin_m.z() - box.base_m - box.gradient.dot(offset)};
  const std::array<double, 3> speed{step_along, step_across, beam.direction.z() - box.gradient.dot(step)};
  const std::array<double, 3> low{-box.half_length_m, -box.half_width_m, box.bottom_m};
  const std::array<double, 3> high{box.half_length_m, box.half_width_m, box.top_m};
  double in_m = -std::numeric_limits<double>::infinity(), out_m = to_m + box.porous_m;
  std::size_t side = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (speed[i] == 0) {
      if (at[i] < low[i] || at[i] > high[i]) return false;
      continue;
    }
    const double inverse = 1 / speed[i];
    const double first_m = ((speed[i] > 0 ? low[i] : high[i]) - at[i]) * inverse;
    const double last_m = ((speed[i] > 0 ? high[i] : low[i]) - at[i]) * inverse;
    if (first_m > in_m) {
      in_m = first_m;
      side = i;
    }
    out_m = std::min(out_m, last_m);
    if (in_m > out_m) return false;
  }
  if (in_m < 0) return false;
  double cosine = std::abs(speed[side]);
  if (box.porous_m > 0) {
    constexpr double kLeaf_m = 0.04;
    const Eigen::Vector3d entry_m = beam.origin_m + in_m * beam.direction;
    const double depth = noise_at(entry_m, kLeaf_m);
    in_m += box.porous_m * depth * depth;
    cosine = 0.3 + 0.7 * noise_at(entry_m + Eigen::Vector3d::Constant(0.5), kLeaf_m);
    if (in_m > out_m) return false;
  }
  if (!(in_m >= from_m && in_m < to_m)) return false;
  const std::size_t face = 2 * side + (speed[side] > 0 ? 0 : 1);
  hit = {in_m, std::min(1.0, cosine), side == 2 ? box.roof : box.side, side == 2 ? Hit::kOther : box.faces[face]};
  return true;
}

}  // namespace roadvec
