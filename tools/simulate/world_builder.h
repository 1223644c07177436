#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/world.h"

namespace roadvec {

/// A short piece of boundary as it truly is, where it meets the ground. Hit::face is its place in the list.
struct TruthPiece {
  std::string_view kind;  ///< curb, barrier, vegetation, vehicle_row, unknown (a road's edge without a kerb)
  double height_m = 0;
  Eigen::Vector2d a_m, b_m;
  bool continues = false;     ///< begins where the piece before it ends
  int phase = 0;              ///< of the scene: 0, or 1 after its change
  std::int32_t earlier = -1;  ///< the piece of phase 0 at the same place
  bool gone = false;          ///< of phase 0, without one of phase 1 at the same place
};

struct BuiltWorld {
  World world;
  std::vector<TruthPiece> truth;
};

/// The line that the car follows: its route, or the first road.
[[nodiscard]] Expected<RoadPath> route_of(const Scene& scene);

/// Lays the scene's roads, puts up everything along them and sets its movers going.
[[nodiscard]] Expected<BuiltWorld> build_world(const Scene& scene);

}  // namespace roadvec
