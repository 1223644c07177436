#pragma once

#include <cstdio>
#include <nlohmann/json_fwd.hpp>

#include "tools/score/matching.h"
#include "tools/score/trajectory.h"

namespace roadvec {

// Parts of reports that several have.

/// A line for each method.
void print_matching(const MatchingScores& scores, std::FILE* out);
[[nodiscard]] nlohmann::json matching_json(const MatchingScores& scores);
[[nodiscard]] nlohmann::json errors_json(const PositionErrors& errors);

}  // namespace roadvec
