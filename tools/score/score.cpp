#include "tools/score/score.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "daemon/config/load.h"
#include "tools/score/visibility.h"

namespace roadvec {
namespace {

Expected<void> load_ours(const ScoreOptions& options, const Anchor& anchor, Score& score) {
  auto map = load_map(options.map / "map.geojson", anchor);
  if (!map) return tl::unexpected(map.error());
  score.map = *std::move(map);
  score.map_m = length_m(sample(score.map.lines, kSampleSpacing_m));
  score.line_count = score.map.lines.lines().size();
  score.vertex_count = score.map.lines.vertices().size();
  auto ours = load_tum(options.map / "trajectory.tum");
  if (!ours) return tl::unexpected(ours.error());
  score.ours = *std::move(ours);
  return {};
}

/// What a client fetches is only known to the daemon, whose report.json may be missing.
MapSize size_of(const std::filesystem::path& map, const Trajectory& ours) {
  MapSize size;
  std::error_code ignored;
  size.geojson_bytes = std::filesystem::file_size(map / "map.geojson", ignored);
  const auto report = nlohmann::json::parse(std::ifstream(map / "report.json"), nullptr, false);
  if (const auto bytes = report.find("map_tile_bytes"); bytes != report.end() && bytes->is_number_unsigned()) {
    size.tile_bytes = bytes->get<std::uintmax_t>();
  }
  for (std::size_t i = 1; i < ours.size(); ++i) {
    size.driven_m += (ours[i].T_map_vehicle.translation() - ours[i - 1].T_map_vehicle.translation()).norm();
  }
  return size;
}

Expected<void> score_way(const TruthSettings& truth, Score& score) {
  auto true_way = load_tum(truth.poses);
  if (!true_way) return tl::unexpected(true_way.error());
  score.true_way = *std::move(true_way);
  const Expected<TrajectoryScore> trajectory = score_trajectory(score.ours, score.true_way);
  if (!trajectory) return tl::unexpected(trajectory.error());
  score.trajectory = *trajectory;
  return {};
}

Expected<void> score_truth(const TruthSettings& truth, const Anchor& anchor, double range_m, Score& score) {
  auto boundaries = load_truth(truth.boundaries, anchor);
  if (!boundaries) return tl::unexpected(boundaries.error());
  score.truth = *std::move(boundaries);
  score.truth_samples = sample(score.truth.lines, kSampleSpacing_m);
  score.visible_truth =
      visible(score.truth_samples, score.truth, score.true_way.empty() ? score.ours : score.true_way, range_m);
  score.boundaries = score_boundaries(score.map.lines, samples_that_count(score.map.lines, score.truth),
                                      score.truth.lines, score.truth_samples, score.visible_truth);
  return {};
}

Expected<void> score_pairs(const Settings& drive, int seed_count, Score& score) {
  if (score.true_way.empty()) return fail("matching is scored against true poses; add truth/poses.tum to the drive");
  const auto run = match_frames(drive, score.true_way);
  if (!run) return tl::unexpected(run.error());
  const std::vector<FramePair> pairs = every_pair(run->frames);
  if (pairs.empty()) return fail("no two sweeps that the truth covers lie 0.8 m apart; does the car move?");
  score.matching = score_matching(run->frames, pairs, seed_count, drive.pipeline.match);
  return {};
}

Expected<void> score_kerbs(const std::filesystem::path& file, const Anchor& anchor, Score& score) {
  const auto kerbs = load_curbstones(file, anchor);
  if (!kerbs) return tl::unexpected(kerbs.error());
  // The two start fixes cannot be the same.
  const Pose2 T_truth_ours = score.trajectory ? score.trajectory->T_truth_ours : Pose2{};
  const auto surveyed = score_surveyed_kerbs(moved(score.map.lines, T_truth_ours), kerbs->lines);
  if (!surveyed) return tl::unexpected(surveyed.error());
  score.surveyed_kerbs = *surveyed;
  return {};
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
  Expected<void> done = load_ours(options, anchor, score);
  if (done) score.size = size_of(options.map, score.ours);
  if (done && !truth.poses.empty()) done = score_way(truth, score);
  if (done && !truth.boundaries.empty()) done = score_truth(truth, anchor, options.range_m, score);
  if (done && options.matching_seed_count > 0) done = score_pairs(*drive, options.matching_seed_count, score);
  if (done && !options.surveyed_kerbs.empty()) done = score_kerbs(options.surveyed_kerbs, anchor, score);
  if (!done) return tl::unexpected(done.error());
  return score;
}

}  // namespace roadvec
