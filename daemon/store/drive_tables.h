#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/graph/recollection.h"
#include "daemon/store/database.h"
#include "daemon/store/drive_journal.h"

namespace roadvec {

/// What a map was made from, as far as it is not in the file yet.
struct DriveRows {
  std::span<const JournalKeyframe> keyframes;
  std::span<const PoseEdge> loops;
  [[nodiscard]] bool empty() const { return keyframes.empty() && loops.empty(); }
};

/// Tables x_keyframes and x_loops. Of keyframes that are there already only the poses change.
[[nodiscard]] Stored<void> write_drive(const Database& database, std::int64_t part, const DriveRows& rows);

/// The keyframes of these parts as one drive, and where they were when they came; empty when there are none. Fails with
/// `damaged` when a row cannot be read or a keyframe is missing between two others. `parts`: the earliest first.
[[nodiscard]] Stored<Recollection> read_drive(const Database& database, std::span<const std::int64_t> parts);

/// How many keyframes that would be, and how near to a place in the map frame the vehicle then came.
struct DriveReach {
  std::int64_t keyframe_count = 0;
  double nearest_m = 0;
};
[[nodiscard]] Stored<DriveReach> reach_of_drive(const Database& database, std::span<const std::int64_t> parts,
                                                const Eigen::Vector2d& place_map);

}  // namespace roadvec
