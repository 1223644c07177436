#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "tools/score/paper_tables.h"
#include "tools/score/score.h"

namespace roadvec {
namespace {

constexpr int kDone = 0, kBadInput = 1, kBadUsage = 2;
constexpr const char* kDescription =
    "Scores a map and a trajectory against the truth of the drive that they were made from.\n\n"
    "MAP_DIR holds map.geojson and trajectory.tum as `roadvecd --drive DRIVE --out MAP_DIR` writes them. What the "
    "drive has\n"
    "truth for (truth/poses.tum, truth/boundaries.geojson) is scored:\n"
    "  size        bytes of the map, as GeoJSON and as the tiles that a client fetches (report.json), per km driven\n"
    "  boundaries  precision, recall and F1 by length within 0.05 to 0.5 m, for all kinds together and kind by kind; "
    "lateral\n"
    "              error; share of the truth that is covered twice; breaks where no line covers both sides. Asked for "
    "is only\n"
    "              truth that was visible: the LiDAR had returns from it within --range, and from somewhere on the way "
    "it is\n"
    "              the first boundary in sight, seen from above. True lines lower than 0.05 m (dropped kerbs, verges) "
    "and those\n"
    "              with \"removed\": true may be mapped or not: they are not asked for, and our lines nearest to them, "
    "within\n"
    "              0.5 m, are not counted\n"
    "  trajectory  error of position from the start pose on, and after the best rotation and shift; error of the "
    "motion\n"
    "              over 10 m\n"
    "  matching    --matching: the front end runs over DRIVE; every sweep is matched with the one 0.8 m ahead, from "
    "--seeds\n"
    "              starts up to 0.5 m and 3 deg off: by ICP of PCL on the obstacle points (one a grid cell, gate 0.5 "
    "m), "
    "and by our\n"
    "              matcher on the lines of the single sweeps, on raw and on simplified LVMs. LVMs 0.8 m apart come "
    "from "
    "one\n"
    "              local grid and share most of what they saw; single sweeps share nothing. A match is lost when it "
    "ends more\n"
    "              than 0.5 m off; one that is refused counts with its start's error; unobserved: the lines leave a "
    "direction\n"
    "              or the heading open, where the start's error stays\n"
    "  kerbs       --kerbs: distance of our curbs to the curbstone ways of a Lanelet2 map, after one shift of at most "
    "2 m\n\n"
    "--paper-tables, without DRIVE and MAP_DIR: Tables I and II of He et al. 2018 and its mapping experiment, the "
    "paper's\n"
    "figures beside ours. Scenes A, B, C and the 860 m loop are simulated (--drives DIR: once, and kept there). In "
    "each "
    "scene\n"
    "eight matchings between nine frames 0.8 m apart in its middle, each from --seeds starts, and the share of points "
    "left\n"
    "by simplification; on the loop the path's error with and without optimisation.";
constexpr const char* kFooter =
    "\nEXIT STATUS\n"
    "  0  scored    1  an input is missing or damaged    2  bad usage\n\n"
    "EXAMPLES\n"
    "  roadvec-simulate block drives/block && roadvecd --drive drives/block --out maps/block\n"
    "  roadvec-score drives/block maps/block --plot errors.svg\n"
    "  roadvec-score drives/karlsruhe maps/karlsruhe --kerbs lanelet2.osm --matching --json\n"
    "  roadvec-score --paper-tables --drives drives --seeds 20\n";

struct Arguments {
  ScoreOptions score;
  PaperTablesOptions tables;
  std::filesystem::path plot;
  int seed_count = 5;
  bool paper_tables = false, matching = false, json = false;
};

int complain(const std::string& what, int status) {
  std::fprintf(stderr, "roadvec-score: %s\n", what.c_str());
  return status;
}

int print_tables(Arguments& arguments) {
  if (isatty(STDERR_FILENO) != 0) {
    arguments.tables.progress = [](const std::string& doing) { std::fprintf(stderr, "\r\x1b[K%s", doing.c_str()); };
  }
  arguments.tables.seed_count = arguments.seed_count;
  const Expected<PaperTables> tables = paper_tables(arguments.tables);
  arguments.tables.progress("");
  if (!tables) return complain(tables.error().message, kBadInput);
  if (arguments.json) {
    std::puts(json_of(*tables).c_str());
  } else {
    print_text(*tables, stdout);
  }
  return kDone;
}

int print_score(Arguments& arguments) {
  if (arguments.score.drive.empty() || arguments.score.map.empty()) {
    return complain("DRIVE and MAP_DIR are needed, or --paper-tables; --help explains", kBadUsage);
  }
  if (arguments.matching) arguments.score.matching_seed_count = arguments.seed_count;
  const Expected<Score> result = score(arguments.score);
  if (!result) return complain(result.error().message, kBadInput);
  if (arguments.json) {
    std::puts(json_of(*result).c_str());
  } else {
    print_text(*result, stdout);
  }
  if (!arguments.plot.empty() && !(std::ofstream(arguments.plot) << picture_of(*result)).flush()) {
    return complain(arguments.plot.string() + ": cannot be written; name a folder you may write to", kBadInput);
  }
  return kDone;
}

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) {
  using namespace roadvec;
  Arguments arguments;
  CLI::App app(kDescription, "roadvec-score");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec-score " ROADVEC_VERSION);
  app.add_option("DRIVE", arguments.score.drive, "drive folder with truth");
  app.add_option("MAP_DIR", arguments.score.map, "folder with map.geojson and trajectory.tum");
  app.add_option("--kerbs", arguments.score.surveyed_kerbs, "Lanelet2 map (OSM XML) with curbstone ways")
      ->type_name("FILE");
  app.add_option("--range", arguments.score.range_m, "distance within which truth must have been seen, m")
      ->capture_default_str()
      ->check(CLI::Range(5.0, 200.0));
  app.add_flag("--matching", arguments.matching, "score the matching of sweeps too");
  app.add_option("--plot", arguments.plot, "picture of truth, map and errors")->type_name("FILE.svg");
  CLI::Option* tables = app.add_flag("--paper-tables", arguments.paper_tables, "the paper's tables with ours beside");
  tables->excludes("DRIVE", "MAP_DIR", "--kerbs", "--plot", "--matching");
  app.add_option("--drives", arguments.tables.drives, "folder that holds or gets the drives of the tables")
      ->type_name("DIR")
      ->needs(tables);
  app.add_option("--seeds", arguments.seed_count, "starts of each matching")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_flag("--json", arguments.json, "one JSON object");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kBadUsage;
  }
  return arguments.paper_tables ? print_tables(arguments) : print_score(arguments);
}
