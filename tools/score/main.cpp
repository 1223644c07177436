#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "tools/score/score.h"

namespace {

constexpr int kBadInput = 1, kBadUsage = 2;
constexpr const char* kDescription =
    "Scores a map and a trajectory against the truth of the drive that they were made from.\n\n"
    "MAP_DIR holds map.geojson and trajectory.tum as `roadvecd --drive DRIVE --out MAP_DIR` writes them. What the "
    "drive has\n"
    "truth for (truth/poses.tum, truth/boundaries.geojson) is scored:\n"
    "  boundaries  precision, recall and F1 by length within 0.05 to 0.5 m, for all kinds together and kind by kind; "
    "lateral\n"
    "              error; share of the truth that is covered twice; breaks where no line covers both sides. Asked for "
    "is only\n"
    "              truth that was visible: the LiDAR had returns from it within --range, and from somewhere on the way "
    "it is\n"
    "              the first boundary in sight, seen from above.\n"
    "  trajectory  error of position from the start pose on, and after the best rotation and shift; error of the "
    "motion\n"
    "              over 10 m\n"
    "  kerbs       --kerbs: distance of our curbs to the curbstone ways of a Lanelet2 map, after one shift of at most "
    "2 m";
constexpr const char* kFooter =
    "\nEXIT STATUS\n"
    "  0  scored    1  an input is missing or damaged    2  bad usage\n\n"
    "EXAMPLES\n"
    "  roadvec-simulate block drives/block && roadvecd --drive drives/block --out maps/block\n"
    "  roadvec-score drives/block maps/block --plot errors.svg\n"
    "  roadvec-score drives/karlsruhe maps/karlsruhe --kerbs lanelet2.osm --json\n";

}  // namespace

int main(int argc, char** argv) {
  using namespace roadvec;
  ScoreOptions options;
  std::filesystem::path plot;
  bool json = false;
  CLI::App app(kDescription, "roadvec-score");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec-score " ROADVEC_VERSION);
  app.add_option("DRIVE", options.drive, "drive folder with truth")->required();
  app.add_option("MAP_DIR", options.map, "folder with map.geojson and trajectory.tum")->required();
  app.add_option("--kerbs", options.surveyed_kerbs, "Lanelet2 map (OSM XML) with curbstone ways")->type_name("FILE");
  app.add_option("--range", options.range_m, "distance within which truth must have been seen, m")
      ->capture_default_str()
      ->check(CLI::Range(5.0, 200.0));
  app.add_option("--plot", plot, "picture of truth, map and errors")->type_name("FILE.svg");
  app.add_flag("--json", json, "one JSON object");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadUsage;
  }
  const Expected<Score> result = score(options);
  if (!result) {
    std::fprintf(stderr, "roadvec-score: %s\n", result.error().message.c_str());
    return kBadInput;
  }
  if (json) {
    std::puts(json_of(*result).c_str());
  } else {
    print_text(*result, stdout);
  }
  if (!plot.empty() && !(std::ofstream(plot) << picture_of(*result)).flush()) {
    std::fprintf(stderr, "roadvec-score: %s: cannot be written; name a folder you may write to\n", plot.c_str());
    return kBadInput;
  }
  return 0;
}
