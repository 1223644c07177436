#pragma once

#include <optional>
#include <vector>

#include "core/pipeline/report.h"
#include "daemon/config/settings.h"
#include "tools/score/trajectory.h"

namespace roadvec {

/// What one sweep offers for matching, in the vehicle frame at the sweep's end.
struct MatchFrame {
  Pose2 T_map_vehicle;  ///< the truth
  double way_m = 0;     ///< truly driven since the first frame
  /// Obstacle points of the sweep alone, de-skewed and projected to the plane, thinned to one for each grid cell: their
  /// mean. What ICP matches.
  std::vector<Eigen::Vector2d> points;
  LineSet sweep;         ///< lines of the sweep alone, as step 6 takes them
  LineSet raw_lvm, lvm;  ///< boundaries of the local grid map after the sweep, before and after simplification
};

struct MatchFrames {
  std::vector<MatchFrame> frames;  ///< of every sweep that the truth covers
  FrontEndReport front_end;
};

/// Runs the front end over a drive.
[[nodiscard]] Expected<MatchFrames> match_frames(const Settings& drive, const Trajectory& truth);

struct FramePair {
  std::size_t reference = 0, moved = 0;
};
/// The paper's frames lie about 0.8 m apart: its absolute errors over its relative ones [He2018, Table II].
inline constexpr double kPairDistance_m = 0.8;
/// Every frame with the one that lies kPairDistance_m ahead of it, or nearest to that; none where the car stood.
[[nodiscard]] std::vector<FramePair> every_pair(const std::vector<MatchFrame>& frames);
/// `count` pairs, each beginning where the last ended, in the middle of the drive. Fewer when the drive is too short.
[[nodiscard]] std::vector<FramePair> chain_of_pairs(const std::vector<MatchFrame>& frames, std::size_t count);

}  // namespace roadvec
