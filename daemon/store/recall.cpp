#include "daemon/store/recall.h"

#include <algorithm>

#include "core/base/angle.h"
#include "core/base/square.h"

namespace roadvec {
namespace {

constexpr double kNear_m = 200.0;  // choice: a start fix is good to some metres, and a drive may begin in a side street
constexpr std::chrono::seconds kShortPause{60};  // choice: a restart

PoseCovariance sure_to(double ahead_m, double aside_m, double heading_deg) {
  return Eigen::Vector3d(square(ahead_m), square(aside_m), square(rad_from_deg(heading_deg))).asDiagonal();
}

/// What GPS and a course over ground are good to.
StartGuess by_fix(const MapPart& part, const Anchor& start) {
  double x_m = 0, y_m = 0, z_m = 0;
  enu_at(part.anchor).Forward(start.latitude_deg, start.longitude_deg, start.height_m, x_m, y_m, z_m);
  return {{x_m, y_m, rad_from_deg(start.yaw_deg)}, sure_to(5, 5, 5)};
}

/// Where it was last, or, when it was driving, up to 40 m further on.
StartGuess by_last_pose(const Recollection& drive) {
  return {drive.graph.poses_map.back() * Pose2{10, 0, 0}, sure_to(10, 2, 3)};
}

}  // namespace

Stored<std::optional<EarlierPart>> find_earlier_part(const std::filesystem::path& path, const Anchor& start,
                                                     std::chrono::seconds pause) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  const Stored<MapFile> file = MapFile::open(path);
  if (!file) return tl::unexpected<StoreError>(file.error());
  const Stored<std::vector<MapPart>> parts = file->parts();
  if (!parts) return tl::unexpected<StoreError>(parts.error());
  std::optional<EarlierPart> best;
  std::int64_t most = 0;
  for (const MapPart& part : *parts) {
    const bool goes_on = std::ranges::any_of(*parts, [&](const MapPart& p) { return p.continues == part.number; });
    if (part.let_go || goes_on) continue;
    const StartGuess fix = by_fix(part, start);
    const Stored<DriveReach> reach = file->reach(part, fix.T_map_odom.translation());
    if (!reach) return tl::unexpected<StoreError>(reach.error());
    if (reach->keyframe_count < std::max<std::int64_t>(most, 1) || reach->nearest_m > kNear_m) continue;
    most = reach->keyframe_count;
    best = EarlierPart{part, {.graph = {}, .keyframes = {}, .guesses = {fix}}};
  }
  if (!best) return best;
  Stored<Recollection> drive = file->drive(best->part);
  if (!drive) return tl::unexpected<StoreError>(drive.error());
  drive->guesses = best->drive.guesses;
  best->drive = std::move(*drive);
  const bool is_newest = best->part.number == parts->back().number;
  std::vector<StartGuess>& guesses = best->drive.guesses;
  guesses.insert(is_newest && pause < kShortPause ? guesses.begin() : guesses.end(), by_last_pose(best->drive));
  return best;
}

}  // namespace roadvec
