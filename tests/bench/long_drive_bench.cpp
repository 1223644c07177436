#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <vector>

#include "core/pipeline/back_end.h"
#include "tests/support/city.h"

namespace roadvec {
namespace {

double resident_MB() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0, resident_pages = 0;
  statm >> pages >> resident_pages;
  return resident_pages * 4096 / 1e6;
}

/// Keyframes of a drive of so many kilometres through a city of 26 km of streets, with drift, into the back end: the
/// time is the back end's alone, `last_km_s` and `p99_ms` are those of the last kilometre.
void long_drive(benchmark::State& state) {
  const double length_m = 1000.0 * static_cast<double>(state.range(0));
  for (auto _ : state) {
    const worlds::City city(12, 3);
    worlds::CityDrive drive(city, city.drive(length_m, 3), {.noise_m = 0.03}, worlds::city_drift(), 3);
    NoProbe probe;
    BackEnd back_end(PipelineConfig{}, {}, probe);
    std::vector<double> last_km_ms;
    double sum_s = 0;
    while (drive.next()) {
      const auto begin = std::chrono::steady_clock::now();
      benchmark::DoNotOptimize(back_end.add(drive.keyframe));
      const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      sum_s += took_s;
      if (drive.keyframe.travelled_m > length_m - 1000) last_km_ms.push_back(1e3 * took_s);
    }
    std::ranges::sort(last_km_ms);
    double last_km_s = 0;
    for (const double ms : last_km_ms) last_km_s += 1e-3 * ms;
    state.SetIterationTime(sum_s);
    state.counters["s_per_km"] = sum_s / static_cast<double>(state.range(0));
    state.counters["last_km_s"] = last_km_s;
    state.counters["p99_ms"] = last_km_ms[last_km_ms.size() * 99 / 100];
    state.counters["resident_MB"] = resident_MB();
    state.counters["loops"] = static_cast<double>(back_end.loops().size());
    state.counters["false"] = static_cast<double>(worlds::count_false(back_end.loops(), drive.truth()));
  }
}
BENCHMARK(long_drive)->Arg(1)->Arg(10)->Arg(50)->Iterations(1)->UseManualTime()->Unit(benchmark::kSecond);

}  // namespace
}  // namespace roadvec
