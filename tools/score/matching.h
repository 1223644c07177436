#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/map/match.h"
#include "tools/score/match_frames.h"

namespace roadvec {

enum class MatchMethod : std::uint8_t { icp, sweep, raw_lvm, lvm };
inline constexpr std::array kMatchMethods{MatchMethod::icp, MatchMethod::sweep, MatchMethod::raw_lvm, MatchMethod::lvm};
[[nodiscard]] const char* name_of(MatchMethod method);  ///< as JSON keys have it
/// For people.
[[nodiscard]] const char* title_of(MatchMethod method);

/// Starts are off by up to this, evenly.
inline constexpr double kStartOff_m = 0.5, kStartOff_deg = 3.0;

/// One method over all pairs and starts. A match that is refused leaves its start, which counts as its error.
struct MatchingScore {
  std::size_t count = 0;
  double mean_m = 0, median_m = 0, most_m = 0;  ///< of the translation's error; most: 95 % are better
  double relative_percent = 0;                  ///< mean of error over distance truly driven [He2018, IV-C]
  double along_mean_m = 0, across_mean_m = 0;   ///< by the vehicle's heading; of the amounts
  double heading_mean_deg = 0;
  double lost_percent = 0;                   ///< off by more than kStartOff_m
  double refused_percent = 0;                ///< our matcher said that there is no match
  double unobserved_percent = 0;             ///< our matcher said that the lines leave a direction or the heading open
  double time_mean_ms = 0, time_p50_ms = 0;  ///< both sides' preparation included
};

struct MatchingScores {
  std::size_t pair_count = 0;
  int seed_count = 0;
  double distance_mean_m = 0;  ///< truly driven between the two of a pair
  /// By kMatchMethods; icp is empty where PCL was absent.
  std::array<std::optional<MatchingScore>, kMatchMethods.size()> methods;
};

/// Every pair from `seed_count` starts, all methods from the same ones. `pairs` is not empty. Reads a clock.
[[nodiscard]] MatchingScores score_matching(const std::vector<MatchFrame>& frames, const std::vector<FramePair>& pairs,
                                            int seed_count, const MatchConfig& config);

}  // namespace roadvec
