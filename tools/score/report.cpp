#include "tools/score/report.h"

#include <nlohmann/json.hpp>
#include <string>

#include "tools/score/score.h"

namespace roadvec {
namespace {

void print_boundaries(const BoundaryScore& score, std::FILE* out) {
  std::fprintf(out, "boundaries    truth %.0f m, of which visible %.0f m\n", score.truth_total_m,
               score.kinds.front().truth_m);
  std::fprintf(out, "  %-12s %8s %8s ", "kind", "map m", "truth m");
  for (const double tolerance_m : kTolerances_m) std::fprintf(out, "    P / R / F1 at %.2f", tolerance_m);
  std::fputc('\n', out);
  for (const KindScore& kind : score.kinds) {
    std::fprintf(out, "  %-12s %8.1f %8.1f ", kind.kind.c_str(), kind.map_m, kind.truth_m);
    for (std::size_t t = 0; t < kTolerances_m.size(); ++t) {
      std::fprintf(out, "   %.3f / %.3f / %.3f", kind.precision[t], kind.recall[t], kind.f1[t]);
    }
    std::fputc('\n', out);
  }
  if (score.lateral_median_m) {
    std::fprintf(out, "  lateral error  median %.3f m, mean %.3f m, 95 %% %.3f m\n", *score.lateral_median_m,
                 *score.lateral_mean_m, *score.lateral_95_m);
  }
  std::fprintf(out, "  duplicated     %.1f %%\n  breaks         %zu: %.2f per 100 m\n", score.duplicated_percent,
               score.break_count, score.breaks_per_100m);
}

void print_size(const MapSize& size, std::FILE* out) {
  const auto row = [&](const char* what, const std::optional<std::uintmax_t>& bytes) {
    if (!bytes) return;
    std::fprintf(out, "  %-13s  %.1f kB", what, 1e-3 * static_cast<double>(*bytes));
    if (const auto per_km = size.per_km(*bytes)) std::fprintf(out, ": %.1f kB per km driven", 1e-3 * *per_km);
    std::fputc('\n', out);
  };
  row("tiles", size.tile_bytes);
  row("GeoJSON", size.geojson_bytes);
}

void print_trajectory(const TrajectoryScore& score, std::FILE* out) {
  std::fprintf(out, "trajectory    %zu poses over %.1f m\n", score.pose_count, score.way_m);
  std::fprintf(out, "  from the start pose  mean %.3f m, rms %.3f m, max %.3f m\n", score.from_start.mean_m,
               score.from_start.rms_m, score.from_start.max_m);
  std::fprintf(out, "  best fit             mean %.3f m, rms %.3f m, max %.3f m\n", score.aligned.mean_m,
               score.aligned.rms_m, score.aligned.max_m);
  if (score.rpe_percent_per_10m) std::fprintf(out, "  relative, over 10 m  %.3f %%\n", *score.rpe_percent_per_10m);
}

template <class T>
nlohmann::json or_null(const std::optional<T>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}

nlohmann::json size_json(const MapSize& size) {
  const auto per_km = size.tile_bytes ? size.per_km(*size.tile_bytes) : std::nullopt;
  return {{"tile_bytes", or_null(size.tile_bytes)},
          {"tile_bytes_per_km", or_null(per_km)},
          {"geojson_bytes", size.geojson_bytes},
          {"geojson_bytes_per_km", or_null(size.per_km(size.geojson_bytes))}};
}

nlohmann::json boundaries_json(const BoundaryScore& score) {
  nlohmann::json kinds = nlohmann::json::object();
  for (const KindScore& kind : score.kinds) {
    kinds[kind.kind] = {{"map_m", kind.map_m},
                        {"truth_m", kind.truth_m},
                        {"precision", kind.precision},
                        {"recall", kind.recall},
                        {"f1", kind.f1}};
  }
  return {{"tolerances_m", kTolerances_m},
          {"kinds", kinds},
          {"truth_total_m", score.truth_total_m},
          {"lateral_median_m", or_null(score.lateral_median_m)},
          {"lateral_mean_m", or_null(score.lateral_mean_m)},
          {"lateral_95_m", or_null(score.lateral_95_m)},
          {"duplicated_percent", score.duplicated_percent},
          {"break_count", score.break_count},
          {"breaks_per_100m", score.breaks_per_100m}};
}

}  // namespace

nlohmann::json errors_json(const PositionErrors& errors) {
  return {{"mean_m", errors.mean_m}, {"rms_m", errors.rms_m}, {"max_m", errors.max_m}};
}

void print_text(const Score& score, std::FILE* out) {
  std::fprintf(out, "map           %.1f m of boundary in %zu lines, %zu vertices\n", score.map_m, score.line_count,
               score.vertex_count);
  print_size(score.size, out);
  if (score.boundaries) print_boundaries(*score.boundaries, out);
  if (score.trajectory) print_trajectory(*score.trajectory, out);
  if (score.matching) {
    std::fputs("matching      against the truth of the motion between two frames; time in ms\n", out);
    print_matching(*score.matching, out);
  }
  if (!score.surveyed_kerbs) return;
  const SurveyedKerbScore& kerbs = *score.surveyed_kerbs;
  std::fprintf(
      out,
      "surveyed kerbs  %.1f m of our %.1f m of curb have one within 1.5 m, after a shift of (%+.2f E, %+.2f N) m\n",
      kerbs.with_counterpart_m, kerbs.curb_m, kerbs.shift_m.x(), kerbs.shift_m.y());
  if (kerbs.median_m) {
    std::fprintf(out, "  distance       median %.3f m, %.1f %% within 0.3 m\n", *kerbs.median_m,
                 kerbs.within_30cm_percent);
  }
}

std::string json_of(const Score& score) {
  nlohmann::json json{
      {"map", {{"length_m", score.map_m}, {"lines", score.line_count}, {"vertices", score.vertex_count}}}};
  json["map"].update(size_json(score.size));
  if (score.boundaries) json["boundaries"] = boundaries_json(*score.boundaries);
  if (score.trajectory) {
    const TrajectoryScore& trajectory = *score.trajectory;
    json["trajectory"] = {{"poses", trajectory.pose_count},
                          {"way_m", trajectory.way_m},
                          {"from_start", errors_json(trajectory.from_start)},
                          {"aligned", errors_json(trajectory.aligned)},
                          {"rpe_percent_per_10m", or_null(trajectory.rpe_percent_per_10m)}};
  }
  if (score.matching) json["matching"] = matching_json(*score.matching);
  if (score.surveyed_kerbs) {
    const SurveyedKerbScore& kerbs = *score.surveyed_kerbs;
    json["surveyed_kerbs"] = {{"shift_east_m", kerbs.shift_m.x()},
                              {"shift_north_m", kerbs.shift_m.y()},
                              {"curb_m", kerbs.curb_m},
                              {"with_counterpart_m", kerbs.with_counterpart_m},
                              {"median_m", or_null(kerbs.median_m)},
                              {"within_0.3m_percent", kerbs.within_30cm_percent}};
  }
  return json.dump();
}

}  // namespace roadvec
