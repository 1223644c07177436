#pragma once

#include <filesystem>
#include <optional>

#include "tools/score/boundary_score.h"
#include "tools/score/surveyed_kerbs.h"
#include "tools/score/trajectory.h"

namespace roadvec {

struct ScoreOptions {
  std::filesystem::path drive, map;      ///< a drive with its truth; what roadvecd --drive made of it
  std::filesystem::path surveyed_kerbs;  ///< a Lanelet2 map; empty: none
  double range_m = 40;                   ///< truth that the sensor never saw from nearer is not asked for
};

/// What a drive has truth for is scored; the rest stays empty.
struct Score {
  double map_m = 0;
  std::size_t line_count = 0, vertex_count = 0;
  std::optional<BoundaryScore> boundaries;
  std::optional<TrajectoryScore> trajectory;
  std::optional<SurveyedKerbScore> surveyed_kerbs;
  // For the picture.
  Boundaries map, truth;
  std::vector<LineSample> truth_samples;
  std::vector<bool> visible_truth;
  Trajectory ours, true_way;
};
[[nodiscard]] Expected<Score> score(const ScoreOptions& options);

void print_text(const Score& score, std::FILE* out);
[[nodiscard]] std::string json_of(const Score& score);
/// Truth, map coloured by its distance from the truth, and both ways, seen from above.
[[nodiscard]] std::string picture_of(const Score& score);

}  // namespace roadvec
