#include <benchmark/benchmark.h>

#include "core/graph/close_loop.h"
#include "core/graph/optimise.h"
#include "tests/support/worlds.h"

namespace roadvec {
namespace {

/// Laps around a block with drifting odometry, as the back end would hold them.
struct Laps {
  PoseGraph graph;
  std::vector<KeptKeyframe> keyframes;

  explicit Laps(int lap_count) {
    worlds::Points path{{30, -1.5}};
    for (int lap = 0; lap < lap_count; ++lap) {
      path.insert(path.end(), {{111.5, -1.5}, {111.5, 71.5}, {-1.5, 71.5}, {-1.5, -1.5}});
    }
    path.push_back({30, -1.5});
    const std::vector<Pose2> truth = worlds::drive_along(path);
    for (const Keyframe& k : worlds::keyframes_of(worlds::block_street(), truth, {.noise_m = 0.03}, {}, 1)) {
      if (!graph.poses_map.empty()) {
        const Pose2 step = graph.poses_map.back().inverse() * k.T_odom_vehicle;
        const Eigen::Vector3d information(400, 400, 6e4);
        graph.odometry.push_back({graph.poses_map.size() - 1, graph.poses_map.size(), step, information.asDiagonal()});
      }
      graph.poses_map.push_back(k.T_odom_vehicle);
      graph.travelled_m.push_back(k.travelled_m);
      keyframes.push_back({k.time, k.T_odom_vehicle, PackedLines(k.lvm), PackedLines(k.structure)});
    }
    // A loop every tenth keyframe of the later laps, at its true place.
    const std::size_t lap = truth.size() / static_cast<std::size_t>(lap_count);
    for (std::size_t k = lap + 10; k < truth.size(); k += 10) {
      const Eigen::Vector3d information(1000, 1000, 1e5);
      graph.loops.push_back({{k - lap, k, truth[k - lap].inverse() * truth[k], information.asDiagonal()}, true});
    }
  }
};

void optimise(benchmark::State& state) {
  const Laps laps(static_cast<int>(state.range(0)));
  const Optimiser optimiser{OptimiseConfig{}};
  OptimiseReport report;
  for (auto _ : state) {
    PoseGraph graph = laps.graph;
    report = optimiser.run(graph);
  }
  state.counters["poses"] = static_cast<double>(laps.graph.poses_map.size());
  state.counters["loops"] = static_cast<double>(laps.graph.loops.size());
  state.counters["iterations"] = report.iteration_count;
}
BENCHMARK(optimise)->Arg(2)->Arg(10)->Unit(benchmark::kMillisecond);

/// The newest keyframe of a drive that is back where it began: candidates, starts, matches.
void close_loop(benchmark::State& state) {
  const Laps laps(static_cast<int>(state.range(0)));
  CloseLoopConfig config;
  config.every_m = 0;
  LoopCloser closer{config, MatchConfig{}};
  PoseGraph graph = laps.graph;
  const Pose2 last = graph.poses_map.back();
  graph.poses_map.pop_back();
  closer.poses_changed(graph, 0);
  graph.poses_map.push_back(last);
  for (auto _ : state) benchmark::DoNotOptimize(closer.run(graph, laps.keyframes));
  state.counters["keyframes"] = static_cast<double>(laps.keyframes.size());
}
BENCHMARK(close_loop)->Arg(2)->Arg(10)->Unit(benchmark::kMicrosecond)->Iterations(50);

}  // namespace
}  // namespace roadvec
