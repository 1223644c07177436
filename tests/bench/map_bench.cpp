#include <benchmark/benchmark.h>

#include <random>

#include "core/map/concatenate.h"
#include "core/map/match.h"
#include "tests/support/worlds.h"

namespace roadvec {
namespace {

/// What the front end matches: some 20 lines with 200 vertices, the world a metre further on, 0.3 m and 2 degrees off.
struct MatchCase {
  LineSet reference, seen;
  Pose2 guess{1.2, 0.2, 0.03};
};
MatchCase match_case() {
  std::mt19937_64 random(1);
  worlds::World world = worlds::crossing(40.0);
  for (int k = 0; k < 16; ++k) {
    const double x = -34.0 + 4.5 * k, y = k % 2 == 0 ? 9.0 : -9.0;
    world.push_back({{x, y}, {x + 2.0, y + 0.6}, {x + 2.2, y + 2.0}});
  }
  const worlds::View view{.range_m = 40.0, .noise_m = 0.04, .tolerance_m = 0.06};
  return {worlds::seen_from(world, {}, view, random), worlds::seen_from(world, {1, 0, 0}, view, random)};
}

void match(benchmark::State& state) {
  const MatchCase c = match_case();
  MatchConfig config;
  config.sample_spacing_m = static_cast<double>(state.range(0)) / 100.0;
  Matcher matcher{config};
  matcher.set_reference(c.reference);
  const double sigma_m = 0.2, sigma_rad = 0.02;
  const PoseCovariance prior =
      Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
  Match result;
  for (auto _ : state) {
    result = matcher.run(c.seen, c.guess, prior);
    benchmark::DoNotOptimize(result);
  }
  state.counters["lines"] = static_cast<double>(c.seen.lines().size());
  state.counters["vertices"] = static_cast<double>(c.seen.vertices().size());
  state.counters["iterations"] = result.iteration_count;
  state.counters["error_mm"] = 1000.0 * (result.pose.translation() - Eigen::Vector2d(1, 0)).norm();
}
BENCHMARK(match)->Arg(25)->Arg(50)->Arg(100)->Arg(200)->Unit(benchmark::kMicrosecond);

void match_set_reference(benchmark::State& state) {
  const MatchCase c = match_case();
  Matcher matcher{MatchConfig{}};
  for (auto _ : state) matcher.set_reference(c.reference);
}
BENCHMARK(match_set_reference)->Unit(benchmark::kMicrosecond);

/// One keyframe into a map of a street 1 km long, already seen once, and the change published.
void concatenate(benchmark::State& state) {
  const worlds::World street = worlds::straight_street(0, 1000);
  const worlds::View view{.range_m = 30.0, .noise_m = 0.03, .tolerance_m = 0.06};
  std::mt19937_64 random(1);
  std::vector<LineSet> views;
  for (int k = 0; k < 500; ++k) views.push_back(worlds::seen_from(street, {2.0 * k, -1.5, 0}, view, random));
  Concatenator concatenator{ConcatenateConfig{}};
  std::uint64_t keyframe = 0;
  const auto add = [&] {
    const std::uint64_t place = keyframe % views.size();
    MapChange change;
    concatenator.add(keyframe++, {}, views[place], {2.0 * static_cast<double>(place), -1.5, 0});
    concatenator.publish(false, change);
  };
  while (keyframe < views.size()) add();
  for (auto _ : state) add();
  state.counters["lines"] = static_cast<double>(concatenator.map().size());
}
BENCHMARK(concatenate)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace roadvec
