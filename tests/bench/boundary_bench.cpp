// Steps 1 to 5 on a street as a 64-beam sensor sees it: 115 000 returns a sweep.

#include <benchmark/benchmark.h>

#include "core/boundary/fuse.h"
#include "core/boundary/segment.h"
#include "core/boundary/simplify.h"
#include "core/boundary/vectorise.h"
#include "tests/support/street.h"

namespace roadvec {
namespace {

struct Bench {
  WindowConfig window;
  Sweep sweep = test::Street{.noise_m = 0.015}.sweep_from(0, 0, 0, 1);
  Segmenter segmenter{{}, window, mounting_from({0, 0, test::Street::kEye_m}, 0, 0, 0), 200'000};
  VirtualScanner scanner{{}}, grid_scanner{{}};
  LocalGrid grid{{}, window, FreeSpace::where_seen};
  Vectoriser vectoriser{{}};
  Simplifier simplifier{{}};
  Path path;

  Bench() {
    path.push({0}, {});
    path.push({100'000'000}, {});
    for (int i = 0; i < 5; ++i) {
      const Segmentation& seen = segmenter.run(sweep, path);
      grid.fuse(scanner.run(seen.boundary, {0, 0}), scanner, seen.seen, {});
    }
  }
};

void segment(benchmark::State& state) {
  Bench bench;
  for (auto _ : state) benchmark::DoNotOptimize(bench.segmenter.run(bench.sweep, bench.path));
  state.counters["returns"] = static_cast<double>(bench.sweep.returns.size());
}
BENCHMARK(segment)->Unit(benchmark::kMicrosecond);

void virtual_scan(benchmark::State& state) {
  Bench bench;
  const Segmentation& seen = bench.segmenter.run(bench.sweep, bench.path);
  for (auto _ : state) benchmark::DoNotOptimize(bench.scanner.run(seen.boundary, {0, 0}));
}
BENCHMARK(virtual_scan)->Unit(benchmark::kMicrosecond);

void fuse(benchmark::State& state) {
  Bench bench;
  const Segmentation& seen = bench.segmenter.run(bench.sweep, bench.path);
  const VirtualScan& scan = bench.scanner.run(seen.boundary, {0, 0});
  for (auto _ : state) bench.grid.fuse(scan, bench.scanner, seen.seen, {});
}
BENCHMARK(fuse)->Unit(benchmark::kMicrosecond);

void vectorise(benchmark::State& state) {
  Bench bench;
  for (auto _ : state) {
    benchmark::DoNotOptimize(bench.vectoriser.run(bench.grid_scanner.run(bench.grid.cells(), {0, 0}), Pose2{}));
  }
}
BENCHMARK(vectorise)->Unit(benchmark::kMicrosecond);

void simplify(benchmark::State& state) {
  Bench bench;
  const LineSet& raw = bench.vectoriser.run(bench.grid_scanner.run(bench.grid.cells(), {0, 0}), Pose2{});
  for (auto _ : state) benchmark::DoNotOptimize(bench.simplifier.run_all(raw));
  state.counters["raw_vertices"] = static_cast<double>(raw.vertices().size());
  state.counters["kept_vertices"] = static_cast<double>(bench.simplifier.run_all(raw).vertices().size());
}
BENCHMARK(simplify)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace roadvec
