#include <nlohmann/json.hpp>

#include "tools/score/report.h"

namespace roadvec {

void print_matching(const MatchingScores& scores, std::FILE* out) {
  std::fprintf(out, "  %zu pairs %.2f m apart, %d starts each, up to %.1f m and %.0f deg off\n", scores.pair_count,
               scores.distance_mean_m, scores.seed_count, kStartOff_m, kStartOff_deg);
  std::fprintf(out, "  %-15s %7s %7s %7s %7s %7s %9s %6s %7s %7s %9s %8s\n", "", "mean m", "median", "95 %", "along",
               "across", "head. deg", "lost %", "refus.%", "unobs.%", "time mean", "p50 ms");
  for (const MatchMethod method : kMatchMethods) {
    const auto& score = scores.methods[static_cast<std::size_t>(method)];
    if (!score) {
      std::fprintf(out, "  %-15s not built: libpcl-dev was absent\n", title_of(method));
      continue;
    }
    std::fprintf(out, "  %-15s %7.3f %7.3f %7.3f %7.3f %7.3f %9.3f %6.1f %7.1f %7.1f %9.2f %8.2f\n", title_of(method),
                 score->mean_m, score->median_m, score->most_m, score->along_mean_m, score->across_mean_m,
                 score->heading_mean_deg, score->lost_percent, score->refused_percent, score->unobserved_percent,
                 score->time_mean_ms, score->time_p50_ms);
  }
}

nlohmann::json matching_json(const MatchingScores& scores) {
  nlohmann::json methods = nlohmann::json::object();
  for (const MatchMethod method : kMatchMethods) {
    const auto& score = scores.methods[static_cast<std::size_t>(method)];
    nlohmann::json& json = methods[name_of(method)];  // null: PCL was absent
    if (!score) continue;
    json = {{"matchings", score->count},
            {"mean_m", score->mean_m},
            {"median_m", score->median_m},
            {"within_95_percent_m", score->most_m},
            {"relative_percent", score->relative_percent},
            {"along_mean_m", score->along_mean_m},
            {"across_mean_m", score->across_mean_m},
            {"heading_mean_deg", score->heading_mean_deg},
            {"lost_percent", score->lost_percent},
            {"refused_percent", score->refused_percent},
            {"unobserved_percent", score->unobserved_percent},
            {"time_mean_ms", score->time_mean_ms},
            {"time_p50_ms", score->time_p50_ms}};
  }
  return {{"pairs", scores.pair_count},
          {"starts", scores.seed_count},
          {"distance_mean_m", scores.distance_mean_m},
          {"methods", methods}};
}

}  // namespace roadvec
