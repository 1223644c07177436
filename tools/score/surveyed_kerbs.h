#pragma once

#include <Eigen/Core>
#include <optional>

#include "tools/score/boundaries.h"

namespace roadvec {

/// Our curbs beside kerbs that somebody surveyed, for drives without a true world. Both references are good to a metre
/// or so, therefore one rigid shift is allowed, and told.
struct SurveyedKerbScore {
  Eigen::Vector2d shift_m = Eigen::Vector2d::Zero();  ///< of our map, east and north, at most 2 m each
  double curb_m = 0;                                  ///< of our map
  double with_counterpart_m = 0;                      ///< of that, a surveyed kerb within 1.5 m
  std::optional<double> median_m;                     ///< of the distances of those
  double within_30cm_percent = 0;
};
/// Error: the map has no curbs.
[[nodiscard]] Expected<SurveyedKerbScore> score_surveyed_kerbs(const LineSet& map, const LineSet& kerbs);

}  // namespace roadvec
