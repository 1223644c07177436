#include "tools/score/score.h"

#include "daemon/config/load.h"
#include "tools/score/visibility.h"

namespace roadvec {
namespace {

/// Our lines in the frame of the truth, when the two start fixes cannot be the same.
LineSet moved(const LineSet& lines, const Pose2& T_truth_ours) {
  LineSet result = lines;
  for (Vertex& vertex : result.vertices()) {
    const Eigen::Vector2d p_m = T_truth_ours * vertex.position();
    vertex.x_m = p_m.x();
    vertex.y_m = p_m.y();
  }
  return result;
}

}  // namespace

Expected<Score> score(const ScoreOptions& options) {
  const Expected<Settings> drive = load_drive(options.drive);
  if (!drive) return tl::unexpected(drive.error());
  if (!drive->anchor)
    return fail(options.drive.string() + "/drive.toml: no [anchor], so map and truth have no common frame");
  const Anchor anchor{drive->anchor->latitude_deg, drive->anchor->longitude_deg, drive->anchor->height_m,
                      drive->anchor->yaw_deg};
  const TruthSettings& truth = drive->truth;
  if (truth.poses.empty() && truth.boundaries.empty() && options.surveyed_kerbs.empty()) {
    return fail(options.drive.string() +
                ": no truth/poses.tum or truth/boundaries.geojson, and drive.toml names no others in [truth]; add one, "
                "or name a "
                "Lanelet2 map by --kerbs");
  }
  Score score;
  auto map = load_geojson(options.map / "map.geojson", anchor);
  if (!map) return tl::unexpected(map.error());
  score.map = *std::move(map);
  score.map_m = length_m(sample(score.map.lines, kSampleSpacing_m));
  score.line_count = score.map.lines.lines().size();
  score.vertex_count = score.map.lines.vertices().size();
  if (!truth.poses.empty()) {
    auto ours = load_tum(options.map / "trajectory.tum"), true_way = load_tum(truth.poses);
    if (!ours) return tl::unexpected(ours.error());
    if (!true_way) return tl::unexpected(true_way.error());
    score.ours = *std::move(ours);
    score.true_way = *std::move(true_way);
    const Expected<TrajectoryScore> trajectory = score_trajectory(score.ours, score.true_way);
    if (!trajectory) return tl::unexpected(trajectory.error());
    score.trajectory = *trajectory;
  }
  if (!truth.boundaries.empty()) {
    auto boundaries = load_geojson(truth.boundaries, anchor);
    if (!boundaries) return tl::unexpected(boundaries.error());
    score.truth = *std::move(boundaries);
    score.truth_samples = sample(score.truth.lines, kSampleSpacing_m);
    score.visible_truth = visible(score.truth_samples, score.truth,
                                  score.true_way.empty() ? score.ours : score.true_way, options.range_m);
    score.boundaries = score_boundaries(score.map.lines, score.truth.lines, score.truth_samples, score.visible_truth);
  }
  if (!options.surveyed_kerbs.empty()) {
    const auto kerbs = load_curbstones(options.surveyed_kerbs, anchor);
    if (!kerbs) return tl::unexpected(kerbs.error());
    const Pose2 T_truth_ours = score.trajectory ? score.trajectory->T_truth_ours : Pose2{};
    const auto surveyed = score_surveyed_kerbs(moved(score.map.lines, T_truth_ours), kerbs->lines);
    if (!surveyed) return tl::unexpected(surveyed.error());
    score.surveyed_kerbs = *surveyed;
  }
  return score;
}

}  // namespace roadvec
