#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "tools/simulate/scene.h"

namespace roadvec {

/// How a surface throws a laser's light back.
struct Surface {
  double reflectivity = 0;   ///< of the light that is scattered, seen straight on
  double roughness_rad = 0;  ///< slope of its facets, sigma: rough ground stays bright at flat angles [OrenNayar1994]
  double gloss = 0;  ///< share under a clear film (lacquer, water, a pane): light at flat angles is mirrored away
  double clear = 0;  ///< share of the light that goes through and is lost behind
};

/// The surfaces of a scene by material; ground that is wet is darker and glossy.
[[nodiscard]] std::array<Surface, kMaterialCount> surfaces_of(const Scene& scene);

/// Share of the light that comes back to its source from a unit of surface, 0..1; `cosine` of beam and normal.
[[nodiscard]] double brightness(const Surface& surface, double cosine);

/// A part of a beam and what it met.
struct SubRay {
  double range_m = 0;      ///< infinite: nothing
  double brightness = 0;   ///< share of its light that comes back
  double weight = 0;       ///< of the pulse's energy
  std::int32_t face = -1;  ///< Hit::face: parts on one face are one echo, however far it is smeared in range
};

/// What the receiver makes of parts of the beam that come back together.
struct Echo {
  double range_m = 0;
  double brightness = 0;
  double power = 0;  ///< over that of the weakest echo that is heard on average
  std::int32_t face = -1;
};

struct Echoes {
  std::array<Echo, 3> list{};  ///< nearest first
  std::size_t count = 0;
};

/// Parts nearer to each other than the receiver can separate make one echo at their mean range, weighted by power: in
/// mid-air, where the beam meets an edge. Parts farther apart are echoes of their own. [VelodyneVLS128, p. 32]
[[nodiscard]] Echoes echoes_of(std::span<SubRay> parts);

}  // namespace roadvec
