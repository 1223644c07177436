#include <nlohmann/json.hpp>

#include "tools/score/paper_tables.h"
#include "tools/score/report.h"

namespace roadvec {
namespace {

constexpr std::array kColumns{MatchMethod::icp, MatchMethod::raw_lvm, MatchMethod::lvm};  // the paper's
constexpr double kPaperLeft_percent = 6;                                                  // [He2018, III-B-2]
constexpr double kPaperLoopMean_m = 0.466, kPaperLoopMax_m = 1.162;                       // [He2018, IV-D]

/// A row for each scene: a figure of ours and the paper's beside it, for each method.
template <class Ours, class Theirs>
void print_columns(const SceneTable& scene, int decimals, Ours&& ours, Theirs&& theirs, std::FILE* out) {
  for (const MatchMethod method : kColumns) {
    const auto m = static_cast<std::size_t>(method);
    if (scene.ours.methods[m]) {
      std::fprintf(out, " %8.*f", decimals, ours(*scene.ours.methods[m]));
    } else {
      std::fprintf(out, " %8s", "absent");
    }
    std::fprintf(out, " (%6.2f)", theirs(*scene.paper[m]));
  }
}

void print_head(const char* title, int groups, std::FILE* out) {
  std::fprintf(out, "\n%s\n%-8s", title, "");
  for (int i = 0; i < groups; ++i) std::fprintf(out, " %17s %17s %17s", "ICP", "raw LVM", "simplified LVM");
  std::fputc('\n', out);
}

void print_tables(const std::vector<SceneTable>& scenes, std::FILE* out) {
  print_head("TABLE I   TIME COST, ms a matching: ours (the paper's)", 1, out);
  for (const SceneTable& scene : scenes) {
    std::fprintf(out, "%-8s", scene.title.c_str());
    print_columns(
        scene, 2, [](const MatchingScore& s) { return s.time_mean_ms; },
        [](const PaperFigures& p) { return p.time_ms; }, out);
    std::fputc('\n', out);
  }
  print_head("TABLE II  ERRORS OF MATCHING, average absolute (m), then average relative (%): ours (the paper's)", 2,
             out);
  for (const SceneTable& scene : scenes) {
    std::fprintf(out, "%-8s", scene.title.c_str());
    print_columns(
        scene, 3, [](const MatchingScore& s) { return s.mean_m; }, [](const PaperFigures& p) { return p.absolute_m; },
        out);
    print_columns(
        scene, 2, [](const MatchingScore& s) { return s.relative_percent; },
        [](const PaperFigures& p) { return p.relative_percent; }, out);
    std::fputc('\n', out);
  }
}

void print_loop(const WholeDriveScore& loop, std::FILE* out) {
  std::fprintf(out, "\nLOOP, %.0f m, closed %llu times: error of position from the start pose on, mean / max\n",
               loop.optimised.way_m, static_cast<unsigned long long>(loop.loop_count));
  const auto row = [out](const char* what, const TrajectoryScore& score, const char* paper) {
    std::fprintf(out, "  %-36s %.3f / %.3f m   %s\n", what, score.from_start.mean_m, score.from_start.max_m, paper);
  };
  row("odometry alone", loop.odometry, "the paper: a picture, no figure");
  row("odometry and matching, not optimised", loop.matched, "");
  row("optimised", loop.optimised, "");
  std::fprintf(out, "  %-36s %.3f / %.3f m\n", "the paper, optimised", kPaperLoopMean_m, kPaperLoopMax_m);
}

nlohmann::json scene_json(const SceneTable& scene) {
  nlohmann::json json = matching_json(scene.ours);
  json["scene"] = scene.title;
  json["drive"] = scene.drive;
  for (const MatchMethod method : kColumns) {
    const PaperFigures& paper = *scene.paper[static_cast<std::size_t>(method)];
    json["paper"][name_of(method)] = {
        {"mean_m", paper.absolute_m}, {"relative_percent", paper.relative_percent}, {"time_mean_ms", paper.time_ms}};
  }
  json["left_of_hits_percent"] = scene.left_of_hits_percent;
  json["left_of_cells_percent"] = scene.left_of_cells_percent;
  json["paper"]["left_of_hits_percent"] = kPaperLeft_percent;
  return json;
}

}  // namespace

void print_text(const PaperTables& tables, std::FILE* out) {
  print_tables(tables.scenes, out);
  std::fputs("\nMORE OF THE SAME MATCHINGS (along and across the road; time in ms)\n", out);
  for (const SceneTable& scene : tables.scenes) {
    std::fprintf(out, "%s (%s)\n", scene.title.c_str(), scene.drive.c_str());
    print_matching(scene.ours, out);
  }
  std::fprintf(out, "\nPOINTS LEFT BY SIMPLIFICATION, %% of the rays' hits (the paper's %.0f), %% of distinct cells\n",
               kPaperLeft_percent);
  for (const SceneTable& scene : tables.scenes) {
    std::fprintf(out, "%-8s %6.1f %6.1f\n", scene.title.c_str(), scene.left_of_hits_percent,
                 scene.left_of_cells_percent);
  }
  print_loop(tables.loop, out);
}

std::string json_of(const PaperTables& tables) {
  nlohmann::json scenes = nlohmann::json::array();
  for (const SceneTable& scene : tables.scenes) scenes.push_back(scene_json(scene));
  const WholeDriveScore& loop = tables.loop;
  const nlohmann::json loop_json{{"way_m", loop.optimised.way_m},
                                 {"loops", loop.loop_count},
                                 {"odometry", errors_json(loop.odometry.from_start)},
                                 {"matched", errors_json(loop.matched.from_start)},
                                 {"optimised", errors_json(loop.optimised.from_start)},
                                 {"paper", {{"mean_m", kPaperLoopMean_m}, {"max_m", kPaperLoopMax_m}}}};
  return nlohmann::json{{"scenes", scenes}, {"loop", loop_json}}.dump();
}

}  // namespace roadvec
