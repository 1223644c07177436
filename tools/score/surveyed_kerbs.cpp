#include "tools/score/surveyed_kerbs.h"

#include <algorithm>
#include <cmath>

#include "tools/score/boundary_score.h"

namespace roadvec {
namespace {

constexpr double kSpacing_m = 0.25;
constexpr double kCounterpart_m =
    1.5;                           // farther is no counterpart: a parked car before it, or a kerb that was not surveyed
constexpr double kCapped_m = 1.0;  // what has no counterpart pulls no harder than this
constexpr double kFirstStep_m = 0.4;
constexpr int kFirstReach = 4, kReach = 2, kLevels = 5;  // 1.6 m, then halved four times: within 2 m, to 2.5 cm

std::vector<LineSample> shifted(std::vector<LineSample> samples, const Eigen::Vector2d& shift_m) {
  for (LineSample& s : samples) s.position_m += shift_m;
  return samples;
}

double cost_m(const std::vector<std::optional<double>>& distances) {
  double sum_m = 0;
  for (const auto& distance : distances) sum_m += std::min(distance.value_or(kCapped_m), kCapped_m);
  return sum_m;
}

}  // namespace

Expected<SurveyedKerbScore> score_surveyed_kerbs(const LineSet& map, const LineSet& kerbs) {
  std::vector<LineSample> curbs;
  for (const LineSample& s : sample(map, kSpacing_m)) {
    if (map.lines()[s.line].attributes.kind == BoundaryKind::curb) curbs.push_back(s);
  }
  if (curbs.empty()) return fail("the map has no lines of kind curb to compare with the surveyed kerbs");
  SurveyedKerbScore score;
  double step_m = kFirstStep_m;
  for (int level = 0; level < kLevels; ++level, step_m /= 2) {
    const int reach = level == 0 ? kFirstReach : kReach;
    const Eigen::Vector2d centre_m = score.shift_m;
    double best_m = cost_m(distances_m(shifted(curbs, centre_m), kerbs, kCounterpart_m));
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        const Eigen::Vector2d shift_m = centre_m + step_m * Eigen::Vector2d(i, j);
        const double here_m = cost_m(distances_m(shifted(curbs, shift_m), kerbs, kCounterpart_m));
        if (here_m < best_m) {
          best_m = here_m;
          score.shift_m = shift_m;
        }
      }
    }
  }
  std::vector<double> near_m;
  for (const auto& distance : distances_m(shifted(curbs, score.shift_m), kerbs, kCounterpart_m)) {
    if (distance) near_m.push_back(*distance);
  }
  std::sort(near_m.begin(), near_m.end());
  score.curb_m = length_m(curbs);
  score.with_counterpart_m = score.curb_m * static_cast<double>(near_m.size()) / static_cast<double>(curbs.size());
  if (near_m.empty()) return score;
  score.median_m = near_m[near_m.size() / 2];
  const auto within = std::upper_bound(near_m.begin(), near_m.end(), 0.3) - near_m.begin();
  score.within_30cm_percent = 100.0 * static_cast<double>(within) / static_cast<double>(near_m.size());
  return score;
}

}  // namespace roadvec
