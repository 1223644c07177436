#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/world.h"

namespace roadvec {

/// A boundary as it truly is: consecutive faces of the world, where each meets the ground.
struct TruthLine {
  std::string_view kind;  ///< curb, barrier, vehicle_row
  double height_m = 0;
  std::int32_t first = 0, last = 0;  ///< faces [first, last)
};

struct BuiltWorld {
  World world;
  std::vector<TruthLine> truth;
};

/// Puts up the scene's sidewalks, walls, poles and parked cars along the road.
[[nodiscard]] Expected<BuiltWorld> build_world(const Scene& scene, const RoadPath& path);

}  // namespace roadvec
