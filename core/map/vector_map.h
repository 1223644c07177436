#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "core/base/time.h"
#include "core/geometry/line_set.h"
#include "core/geometry/pose2.h"

namespace roadvec {

using LineId = std::uint64_t;

/// One boundary of the road in the `map` frame, as it is published.
struct MapLine {
  LineId id = 0;
  std::uint32_t revision = 0;  ///< grows by one with every published change
  LineAttributes attributes;
  SensorTime first_seen, last_seen;
  std::vector<Vertex> vertices;
};

/// A line that went, and into which lines (none: nothing took its place).
struct Lineage {
  LineId retired = 0;
  std::vector<LineId> successors;
};

/// What one keyframe changed in the published map. Lines are in ascending order of id.
struct MapChange {
  std::vector<LineId> upserted;
  std::vector<LineId> removed;
  std::vector<Lineage> lineage;
  bool closed_loop = false;  ///< T_map_odom jumped: announce it before the lines move
  bool begins_anew = false;  ///< the map so far is forgotten; ids may come again
  Pose2 T_map_odom;
  SensorTime time;  ///< of the keyframe
  [[nodiscard]] bool empty() const { return upserted.empty() && removed.empty(); }
};

/// The published map: ordered by id, so that a walk over it is the same everywhere.
using VectorMap = std::map<LineId, MapLine>;

}  // namespace roadvec
