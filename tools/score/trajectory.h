#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose2.h"

namespace roadvec {

struct StampedPose {
  double t_s = 0;
  Pose2 T_map_vehicle;
};
using Trajectory = std::vector<StampedPose>;

/// A TUM file: t x y z qx qy qz qw, by growing time. Errors name file and line.
[[nodiscard]] Expected<Trajectory> load_tum(const std::filesystem::path& file);
/// Between two poses by their share; empty outside the trajectory.
[[nodiscard]] std::optional<Pose2> pose_at(const Trajectory& trajectory, double t_s);

struct PositionErrors {
  double mean_m = 0, rms_m = 0, max_m = 0;
};
struct TrajectoryScore {
  std::size_t pose_count = 0;  ///< ours that the truth covers
  double way_m = 0;
  PositionErrors from_start;                  ///< both begin at the same pose, as [He2018, IV-C] measures
  PositionErrors aligned;                     ///< after the rotation and shift that fit best
  std::optional<double> rpe_percent_per_10m;  ///< error of the motion over 10 m; empty: the drive is shorter
  Pose2 T_truth_ours;                         ///< of the best fit
};
/// Error: the two share no time.
[[nodiscard]] Expected<TrajectoryScore> score_trajectory(const Trajectory& ours, const Trajectory& truth);

}  // namespace roadvec
