#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tools/score/matching.h"
#include "tools/score/whole_drive.h"

namespace roadvec {

struct PaperTablesOptions {
  int seed_count = 10;
  std::filesystem::path drives;  ///< holds or gets the drives; empty: a temporary folder, removed afterwards
  std::function<void(const std::string& doing)> progress = [](const std::string&) {};
};

/// What the paper has for ICP, raw and simplified LVMs.
struct PaperFigures {
  double absolute_m = 0, relative_percent = 0, time_ms = 0;
};
struct SceneTable {
  std::string title, drive;  ///< "Scene A", "scene_a"
  std::array<std::optional<PaperFigures>, kMatchMethods.size()> paper;
  MatchingScores ours;
  double left_of_hits_percent = 0;   ///< vertices of the simplified LVM over rays that met it: as the paper counts
  double left_of_cells_percent = 0;  ///< over the raw LVM's vertices: one for each cell met
};
struct PaperTables {
  std::vector<SceneTable> scenes;
  WholeDriveScore loop;
};

/// Tables I and II of [He2018] and its mapping experiment, on the shipped scenes scene_a, scene_b, scene_c and
/// paper_loop, made where they are missing. Eight matchings between nine frames in the middle of each scene, each from
/// seed_count starts.
[[nodiscard]] Expected<PaperTables> paper_tables(const PaperTablesOptions& options);

void print_text(const PaperTables& tables, std::FILE* out);
[[nodiscard]] std::string json_of(const PaperTables& tables);

}  // namespace roadvec
