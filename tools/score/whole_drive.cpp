#include "tools/score/whole_drive.h"

#include "core/pipeline/back_end.h"
#include "core/pipeline/front_end.h"
#include "tools/score/drive_reader.h"

namespace roadvec {

Expected<WholeDriveScore> score_whole_drive(const Settings& drive, const Trajectory& truth) {
  auto reader = DriveReader::open(drive);
  if (!reader) return tl::unexpected(reader.error());
  NoProbe probe;
  FrontEnd front_end(drive.pipeline, (*reader)->setup(), probe);
  BackEnd back_end(drive.pipeline, {0, 0, drive.anchor ? rad_from_deg(drive.anchor->yaw_deg) : 0}, probe);
  Odometry alone(drive.pipeline.odometry, (*reader)->setup().vehicle);
  Keyframe keyframe;
  Trajectory odometry, matched, optimised;
  while (const Sweep* sweep = (*reader)->next()) {
    (void)alone.integrate((*reader)->motion(), sweep->start, sweep->end);
    if (front_end.add(*sweep, (*reader)->motion(), &keyframe) == nullptr) continue;
    (void)back_end.add(keyframe);
    const double t_s = static_cast<double>(keyframe.time.ns) * 1e-9;
    odometry.push_back({t_s, alone.pose()});
    matched.push_back({t_s, keyframe.T_odom_vehicle});
  }
  if (const std::string error = (*reader)->error(); !error.empty()) return fail(error);
  (void)back_end.finish();
  for (const TrajectoryPoint& point : back_end.trajectory()) {
    optimised.push_back({static_cast<double>(point.time.ns) * 1e-9, point.T_map_vehicle});
  }
  WholeDriveScore score;
  score.loop_count = back_end.report().loops.accepted_count;
  for (const auto& [ours, result] : {std::pair(&odometry, &score.odometry), std::pair(&matched, &score.matched),
                                     std::pair(&optimised, &score.optimised)}) {
    const Expected<TrajectoryScore> scored = score_trajectory(*ours, truth);
    if (!scored) return tl::unexpected(scored.error());
    *result = *scored;
  }
  return score;
}

}  // namespace roadvec
