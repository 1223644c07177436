#include <algorithm>
#include <cmath>

#include "tools/simulate/scenery_cast.h"

namespace roadvec {

struct Scenery::Crossing {
  double range_m, share;
  std::uint32_t kerb;
};

/// Where a beam has come down to a sheet.
struct Scenery::Footing {
  double range_m = 0, height_m = 0;
  Eigen::Vector2d place_m, gradient;
  double bump_m = 0;  ///< how much nearer a bump there is met
};

/// Beams through a cell in which one of them at least may come down to the ground.
void Scenery::meet_low(const Stretch& stretch, float ground_m, Cast& cast) const {
  const Cell& cell = stretch.cell;
  const bool has_edges = cell.first != cell.solid;
  Footing middle;
  bool has_middle = false;
  for (std::size_t k = 0; k < cast.beams.size(); ++k) {
    const Beam& beam = cast.beams[k];
    Hit& hit = cast.hits[k];
    if (hit.range_m <= stretch.from_m) continue;
    Stretch own = stretch;
    own.to_m = std::min(stretch.to_m, hit.range_m);
    const unsigned bit = 1U << k;
    if (std::min(beam.height_m(own.from_m), beam.height_m(own.to_m)) > ground_m) {
      cast.followed &= ~bit;
      continue;
    }
    if (has_edges) {
      if ((cast.followed & bit) == 0) cast.over_road[k] = on_road(beam.place_m(own.from_m));
      meet_edges(own, beam, cast.over_road[k], hit);
    } else {
      cast.over_road[k] = cell.on_road;
      const Sheet sheet = cell.on_road ? Sheet::road : Sheet::beside;
      double range_m = 0;
      if (k == 0) {
        has_middle = meet_sheet(sheet, own, beam, middle, hit);
      } else if (has_middle && find_beside(middle, sheet, own, beam, range_m)) {
        hit = cast.hits.front();
        hit.range_m = range_m - middle.bump_m;
      } else {
        Footing other;
        meet_sheet(sheet, own, beam, other, hit);
      }
    }
    cast.followed |= bit;
  }
}

/// Whether a beam comes down to the plane that touches the sheet where the one beside it did, and that is the sheet.
bool Scenery::find_beside(const Footing& middle, Sheet sheet, const Stretch& stretch, const Beam& beam,
                          double& range_m) const {
  constexpr double kFlat_m = 0.0005;
  const double ground_m = middle.height_m - middle.gradient.dot(middle.place_m);
  const double above_m = beam.origin_m.z() - ground_m - middle.gradient.dot(beam.origin_m.head<2>());
  range_m = above_m / (middle.gradient.dot(beam.direction.head<2>()) - beam.direction.z());
  if (!(range_m >= stretch.from_m && range_m < stretch.to_m)) return false;
  if (stretch.cell.patches[static_cast<std::size_t>(sheet)].even) return true;
  const Eigen::Vector2d place_m = beam.place_m(range_m);
  return std::abs(beam.height_m(range_m) - ground_.height_m(sheet, place_m.x(), place_m.y())) < kFlat_m;
}

/// Ranges in the stretch at which the beam crosses the road's edge, nearest first.
std::size_t Scenery::crossings_in(const Stretch& stretch, const Beam& beam, Crossing* crossings) const {
  std::size_t count = 0;
  const Eigen::Vector2d step = beam.direction.head<2>(), origin_m = beam.origin_m.head<2>();
  for (std::uint32_t i = stretch.cell.first; i < stretch.cell.solid; ++i) {
    const Kerb& kerb = things_.kerbs[items_[i]];
    const Eigen::Vector2d offset = kerb.a_m - origin_m;
    const double left_a = cross(step, offset), left_b = cross(step, kerb.b_m - origin_m);
    if ((left_a < 0) == (left_b < 0)) continue;
    const double inverse = 1 / (left_b - left_a);
    const double range_m = cross(offset, kerb.b_m - kerb.a_m) * inverse;
    if (!(range_m >= stretch.from_m && range_m < stretch.to_m)) continue;
    std::size_t place = count++;
    for (; place > 0 && crossings[place - 1].range_m > range_m; --place) crossings[place] = crossings[place - 1];
    crossings[place] = {range_m, -left_a * inverse, items_[i]};
  }
  return count;
}

/// Where edges run: from one crossing of them to the next.
void Scenery::meet_edges(Stretch stretch, const Beam& beam, bool& over_road, Hit& hit) const {
  std::array<Crossing, kMostKerbs> crossings;
  const std::size_t count = crossings_in(stretch, beam, crossings.data());
  const double to_m = stretch.to_m;
  Footing footing;
  for (std::size_t i = 0; i < count; ++i) {
    stretch.to_m = crossings[i].range_m;
    if (meet_sheet(over_road ? Sheet::road : Sheet::beside, stretch, beam, footing, hit)) return;
    if (meet_kerb(crossings[i], beam, over_road, hit)) return;
    stretch.from_m = crossings[i].range_m;
  }
  stretch.to_m = to_m;
  meet_sheet(over_road ? Sheet::road : Sheet::beside, stretch, beam, footing, hit);
}

/// The first place in the stretch where the beam comes down to the sheet, and the bump there.
bool Scenery::meet_sheet(Sheet sheet, const Stretch& stretch, const Beam& beam, Footing& footing, Hit& hit) const {
  const Patch& patch = stretch.cell.patches[static_cast<std::size_t>(sheet)];
  if (!(patch.even ? find_even(patch, stretch, beam, footing) : find_uneven(sheet, stretch, beam, footing)))
    return false;
  settle(patch, beam, stretch.from_m, footing, hit);
  return true;
}

/// Bilinear between the cell's corners: nearly a plane.
bool Scenery::find_even(const Patch& patch, const Stretch& stretch, const Beam& beam, Footing& footing) const {
  const std::array<float, 4>& corners_m = patch.corners_m;
  const double a = corners_m[0], b = corners_m[1] - a, c = corners_m[2] - a, d = corners_m[3] - a - b - c;
  constexpr double kPer_m = 1 / kCell_m;
  const Eigen::Vector2d begin_m = beam.place_m(stretch.from_m);
  const double u = (begin_m.x() - stretch.corner_m.x()) * kPer_m, du = beam.direction.x() * kPer_m;
  const double v = (begin_m.y() - stretch.corner_m.y()) * kPer_m, dv = beam.direction.y() * kPer_m;
  // The clearance is high + falls * s + bends * s^2, s from the stretch's begin on.
  const double high_m = beam.height_m(stretch.from_m) - (a + u * (b + v * d) + v * c);
  const double falls = beam.direction.z() - du * (b + v * d) - dv * (c + u * d), bends = -du * dv * d;
  const double length_m = stretch.to_m - stretch.from_m;
  if (high_m > 0 && high_m + length_m * (falls + length_m * bends) > 0) return false;
  double at_m = 0;
  if (high_m > 0) {
    // The straight line's root, and what the bend makes of it.
    const double inverse = -1 / std::min(falls, -1e-9);
    at_m = high_m * inverse;
    at_m = std::clamp(at_m + bends * at_m * at_m * inverse, 0.0, length_m);
  }
  footing.range_m = stretch.from_m + at_m;
  footing.place_m = beam.place_m(footing.range_m);
  footing.height_m = beam.height_m(footing.range_m);
  footing.gradient = {(b + (v + at_m * dv) * d) * kPer_m, (c + (u + at_m * du) * d) * kPer_m};
  return true;
}

bool Scenery::meet_kerb(const Crossing& crossing, const Beam& beam, bool& over_road, Hit& hit) const {
  const Kerb& kerb = things_.kerbs[crossing.kerb];
  const Eigen::Vector2d along = kerb.b_m - kerb.a_m;
  const double outwards = cross(along, beam.direction.head<2>()) / along.norm();
  over_road = outwards < 0;
  if (over_road) return false;
  const double z_m = beam.height_m(crossing.range_m);
  const double top_m = std::lerp(kerb.top_a_m, kerb.top_b_m, crossing.share);
  const double foot_m = std::lerp(kerb.foot_a_m, kerb.foot_b_m, crossing.share);
  if (z_m > top_m || top_m - foot_m < 1e-4) return false;
  // The upper edge is a quarter of a circle: the higher the beam, the farther back it meets it.
  const double round_m = std::min(kerb.round_m, top_m - foot_m), up_m = z_m - (top_m - round_m);
  double back_m = 0, cosine = outwards;
  if (up_m > 0) {
    back_m = round_m - std::sqrt(std::max(0.0, round_m * round_m - up_m * up_m));
    const double tilt = up_m / round_m;
    cosine = std::abs(outwards * std::sqrt(1 - tilt * tilt) - beam.direction.z() * tilt);
  }
  hit = {crossing.range_m + std::min(back_m / std::max(outwards, 0.1), 0.1), std::min(cosine, 1.0), Material::kerb,
         kerb.face};
  return true;
}

/// By steps, and by the sheet's slopes from there.
bool Scenery::find_uneven(Sheet sheet, const Stretch& stretch, const Beam& beam, Footing& footing) const {
  const double from_m = stretch.from_m, to_m = stretch.to_m;
  const auto clearance_m = [&](double range_m) {
    return beam.height_m(range_m) - ground_.height_m(sheet, beam.origin_m.x() + range_m * beam.direction.x(),
                                                     beam.origin_m.y() + range_m * beam.direction.y());
  };
  constexpr double kSpacing_m = 0.7, kNear_m = 0.1, kClose_m = 1e-4;
  double low_m = from_m, low_clearance_m = clearance_m(from_m);
  double high_m = to_m, high_clearance_m = clearance_m(to_m);
  if (low_clearance_m > 0 && high_clearance_m > 0) {
    // Between two places above the sheet the beam may graze a crest.
    if (high_clearance_m > kNear_m && low_clearance_m > kNear_m) return false;
    const int steps = static_cast<int>(std::ceil(beam.direction.head<2>().norm() * (to_m - from_m) / kSpacing_m));
    for (int i = 1; i < steps; ++i) {
      high_m = std::lerp(from_m, to_m, static_cast<double>(i) / steps);
      high_clearance_m = clearance_m(high_m);
      if (high_clearance_m <= 0) break;
      low_m = high_m;
      low_clearance_m = high_clearance_m;
    }
    if (high_clearance_m > 0) return false;
  }
  // Where the straight line through both clearances comes down, then where the sheet there would be met if it went on.
  footing.range_m = low_m;
  if (low_clearance_m > 0) {
    footing.range_m += (high_m - low_m) * low_clearance_m / (low_clearance_m - high_clearance_m);
  }
  for (int i = 0; i < 5; ++i) {
    footing.place_m = beam.place_m(footing.range_m);
    footing.height_m = beam.height_m(footing.range_m);
    const Ground::Level level = ground_.level(sheet, footing.place_m);
    footing.gradient = level.gradient;
    const double here_m = footing.height_m - level.height_m;
    if (std::abs(here_m) < kClose_m || low_clearance_m <= 0) break;
    (here_m > 0 ? low_m : high_m) = footing.range_m;
    const double sinks = level.gradient.dot(beam.direction.head<2>()) - beam.direction.z();
    const double next_m = footing.range_m + here_m / sinks;
    footing.range_m = next_m > low_m && next_m < high_m ? next_m : (low_m + high_m) / 2;
  }
  return true;
}

/// The hit where a beam has come down to the ground, with the bump that is there.
void Scenery::settle(const Patch& patch, const Beam& beam, double from_m, Footing& footing, Hit& hit) const {
  const Material material = patch.uniform ? patch.material : ground_.material(footing.place_m);
  const double sinks = footing.gradient.dot(beam.direction.head<2>()) - beam.direction.z();
  const double rough_m = roughness_m_[static_cast<std::size_t>(material)];
  if (rough_m > 0) {
    // Met farther off along the beam the flatter that comes in.
    constexpr double kBump_m = 0.05, kMost_m = 0.3;
    const double bump_m = rough_m * (2 * plan_noise_at(footing.place_m, kBump_m) - 1);
    footing.bump_m = std::clamp(bump_m / std::max(sinks, 1e-3), -kMost_m, kMost_m);
  }
  const double slope2 = footing.gradient.squaredNorm();
  hit = {std::max(from_m, footing.range_m - footing.bump_m), std::clamp(sinks / std::sqrt(1 + slope2), 0.0, 1.0),
         material, Hit::kGround};
}

}  // namespace roadvec
