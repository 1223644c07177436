#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tools/score/boundaries.h"

namespace roadvec {

inline constexpr std::array<double, 5> kTolerances_m{0.05, 0.1, 0.2, 0.3, 0.5};
inline constexpr double kSampleSpacing_m = 0.1;

/// How much of a map is true and how much of the truth is in it, by length.
struct KindScore {
  std::string kind;  ///< "all": whatever kind either side says
  double map_m = 0, truth_m = 0;
  std::array<double, kTolerances_m.size()> precision{}, recall{}, f1{};
};

struct BoundaryScore {
  std::vector<KindScore> kinds;  ///< "all" first
  double truth_total_m = 0;      ///< visible or not
  /// Distance of the map to the nearest truth, over what lies within 0.5 m of some.
  std::optional<double> lateral_median_m, lateral_mean_m, lateral_95_m;
  double duplicated_percent = 0;  ///< of the covered truth: covered more than once
  std::size_t break_count =
      0;  ///< where two neighbouring covered pieces of a visible truth line have no map line in common
  double breaks_per_100m = 0;  ///< of visible truth
};

/// `map_samples`: those of samples_that_count(). `visible_truth`: one flag for each sample of the truth at
/// kSampleSpacing_m. Truth that is not visible can still make a map line right, but is not asked for.
[[nodiscard]] BoundaryScore score_boundaries(const LineSet& map, const std::vector<LineSample>& map_samples,
                                             const LineSet& truth, const std::vector<LineSample>& truth_samples,
                                             const std::vector<bool>& visible_truth);

/// The map at kSampleSpacing_m, without what lies on an optional line: nearer to it than to any other truth, and within
/// 0.5 m.
[[nodiscard]] std::vector<LineSample> samples_that_count(const LineSet& map, const Boundaries& truth);

/// Distance of each sample to the nearest of `lines`; empty: farther than `gate_m`.
[[nodiscard]] std::vector<std::optional<double>> distances_m(const std::vector<LineSample>& samples,
                                                             const LineSet& lines, double gate_m);

}  // namespace roadvec
