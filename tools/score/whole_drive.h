#pragma once

#include "daemon/config/settings.h"
#include "tools/score/trajectory.h"

namespace roadvec {

/// A drive through the whole pipeline: the path against the truth, from what there is of it at three points.
struct WholeDriveScore {
  TrajectoryScore odometry;   ///< step 0 alone: CAN and IMU
  TrajectoryScore matched;    ///< steps 0 to 6, before any loop is closed
  TrajectoryScore optimised;  ///< at the end, as roadvecd writes it
  std::uint64_t loop_count = 0;
};
[[nodiscard]] Expected<WholeDriveScore> score_whole_drive(const Settings& drive, const Trajectory& truth);

}  // namespace roadvec
