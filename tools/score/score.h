#pragma once

#include <filesystem>
#include <optional>

#include "tools/score/boundary_score.h"
#include "tools/score/matching.h"
#include "tools/score/surveyed_kerbs.h"
#include "tools/score/trajectory.h"

namespace roadvec {

struct ScoreOptions {
  std::filesystem::path drive, map;      ///< a drive with its truth; what roadvecd --drive made of it
  std::filesystem::path surveyed_kerbs;  ///< a Lanelet2 map; empty: none
  double range_m = 40;                   ///< truth that the sensor never saw from nearer is not asked for
  int matching_seed_count = 0;           ///< 0: matching is not scored
};

/// Bytes of the published map.
struct MapSize {
  std::uintmax_t geojson_bytes = 0;
  std::optional<std::uintmax_t> tile_bytes;  ///< what a client fetches; empty: report.json does not say
  double driven_m = 0;                       ///< by our own path; 0: not known
  [[nodiscard]] std::optional<double> per_km(std::uintmax_t bytes) const {
    return driven_m > 0 ? std::optional(static_cast<double>(bytes) / (1e-3 * driven_m)) : std::nullopt;
  }
};

/// What a drive has truth for is scored; the rest stays empty.
struct Score {
  double map_m = 0;
  std::size_t line_count = 0, vertex_count = 0;
  MapSize size;
  std::optional<BoundaryScore> boundaries;
  std::optional<TrajectoryScore> trajectory;
  std::optional<MatchingScores> matching;
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
