#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "tools/simulate/scenery.h"

namespace roadvec {

/// Beams side by side, which take the first one's way.
struct Scenery::Cast {
  std::span<const Beam> beams;
  std::span<Hit> hits;
  double from_m;
  double low_m, sinks;    ///< no beam is lower than low_m + range * sinks
  double stray_m = 0;     ///< no beam is farther than this from the first one, seen from above
  double end_m = 0;       ///< from here on nothing is nearer than the hits are
  int low_step = -2;      ///< the last one at which a beam was close to the ground
  unsigned followed = 0;  ///< bits: beams of which over_road tells, as long as they are close to the ground
  std::array<bool, kMostBeams> over_road{};

  Cast(std::span<const Beam> some, double start_m, std::span<Hit> found)
      : beams(some),
        hits(found),
        from_m(start_m),
        low_m(beams.front().origin_m.z()),
        sinks(beams.front().direction.z()) {
    find_end();
    for (const Beam& beam : beams) {
      low_m = std::min(low_m, beam.origin_m.z());
      sinks = std::min(sinks, beam.direction.z());
      const Eigen::Vector2d off_m = (beam.origin_m - beams.front().origin_m).head<2>();
      const Eigen::Vector2d spread = (beam.direction - beams.front().direction).head<2>();
      stray_m = std::max(stray_m, off_m.lpNorm<1>() + end_m * spread.lpNorm<1>());
    }
  }

  [[nodiscard]] double lowest_m(double range_m) const { return low_m + range_m * sinks; }
  void find_end() {
    end_m = hits.front().range_m;
    for (const Hit& hit : hits) end_m = std::max(end_m, hit.range_m);
  }
};

}  // namespace roadvec
