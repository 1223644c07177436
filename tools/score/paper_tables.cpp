#include "tools/score/paper_tables.h"

#include <cmath>
#include <optional>
#include <stdexcept>

#include "daemon/config/load.h"
#include "tools/recording/temporary_folder.h"
#include "tools/simulate/scene_file.h"
#include "tools/simulate/simulate.h"

namespace roadvec {
namespace {

constexpr std::size_t kMatchings = 8;  // between nine frames [He2018, IV-C]
constexpr const char* kLoop = "paper_loop";

struct Drive {
  Settings settings;
  Trajectory truth;
};

/// The drive of a shipped scene, made if it is not there yet.
Expected<Drive> drive_of(const std::string& scene_name, const std::filesystem::path& folder,
                         const PaperTablesOptions& options) {
  const std::filesystem::path path = folder / scene_name;
  if (!std::filesystem::exists(path / "drive.toml")) {
    const auto scene = load_scene(scene_name);
    if (!scene) return tl::unexpected(scene.error());
    SimulateOptions simulation;
    simulation.progress = [&](double done_s, double whole_s) {
      options.progress("simulating " + scene_name + ": " + std::to_string(std::lround(done_s)) + " of " +
                       std::to_string(std::lround(whole_s)) + " s");
    };
    const auto made = simulate(*scene, scene_name, path, simulation);
    if (!made) return tl::unexpected(made.error());
  }
  auto settings = load_drive(path);
  if (!settings) return tl::unexpected(settings.error());
  auto truth = load_tum(settings->truth.poses);
  if (!truth) return tl::unexpected(truth.error());
  return Drive{*std::move(settings), *std::move(truth)};
}

/// Empty but for titles and the paper's figures: Tables I and II of [He2018].
std::vector<SceneTable> scenes_of_paper() {
  using P = PaperFigures;
  const std::optional<P> none;
  return {{.title = "Scene A",
           .drive = "scene_a",
           .paper = {P{0.65, 54.12, 98.05}, none, P{0.55, 32.33, 85.39}, P{0.07, 9.48, 3.98}},
           .ours = {}},
          {.title = "Scene B",
           .drive = "scene_b",
           .paper = {P{0.16, 17.27, 58.37}, none, P{0.13, 13.49, 43.65}, P{0.06, 7.12, 3.74}},
           .ours = {}},
          {.title = "Scene C",
           .drive = "scene_c",
           .paper = {P{0.38, 85.91, 22.63}, none, P{0.12, 24.45, 19.61}, P{0.08, 9.32, 2.18}},
           .ours = {}}};
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0;
}

Expected<void> fill(SceneTable& scene, const Drive& drive, int seed_count) {
  const auto run = match_frames(drive.settings, drive.truth);
  if (!run) return tl::unexpected(run.error());
  const std::vector<FramePair> pairs = chain_of_pairs(run->frames, kMatchings);
  if (pairs.size() < kMatchings) {
    return fail(scene.drive + ": too short for nine frames 0.8 m apart in its middle; make it anew");
  }
  scene.ours = score_matching(run->frames, pairs, seed_count, drive.settings.pipeline.match);
  const FrontEndReport& report = run->front_end;
  scene.left_of_hits_percent = percent(report.kept_vertex_count, report.raw_ray_count);
  scene.left_of_cells_percent = percent(report.kept_vertex_count, report.raw_vertex_count);
  return {};
}

}  // namespace

Expected<PaperTables> paper_tables(const PaperTablesOptions& options) {
  std::optional<TemporaryFolder> temporary;
  try {
    if (options.drives.empty()) temporary.emplace();
  } catch (const std::runtime_error& error) {
    return fail(std::string(error.what()) + "; set TMPDIR, or say by --drives where the drives go");
  }
  const std::filesystem::path folder = temporary ? temporary->path() : options.drives;
  PaperTables tables{.scenes = scenes_of_paper(), .loop = {}};
  for (SceneTable& scene : tables.scenes) {
    const auto drive = drive_of(scene.drive, folder, options);
    if (!drive) return tl::unexpected(drive.error());
    options.progress("matching " + scene.drive);
    if (const auto filled = fill(scene, *drive, options.seed_count); !filled) return tl::unexpected(filled.error());
  }
  const auto loop = drive_of(kLoop, folder, options);
  if (!loop) return tl::unexpected(loop.error());
  options.progress(std::string("mapping ") + kLoop);
  const auto score = score_whole_drive(loop->settings, loop->truth);
  if (!score) return tl::unexpected(score.error());
  tables.loop = *score;
  return tables;
}

}  // namespace roadvec
