#include "core/boundary/segment.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/street.h"

namespace roadvec {
namespace {

using test::Street;

struct Fixture {
  WindowConfig window;
  SegmentConfig config;
  Segmenter segmenter{config, window, mounting_from({0, 0, Street::kEye_m}, 0, 0, 0), 200'000};

  const Segmentation& see(const Street& street, unsigned seed = 0) {
    path.clear();
    path.push({0}, {});
    path.push({100'000'000}, {});
    return segmenter.run(street.sweep_from(0, 0, 0, seed), path);
  }
  /// Odom position of a cell.
  static Eigen::Vector2d position(const CellMap& map, const BoundaryCell& cell) {
    return map.window().origin_odom() + Eigen::Vector2d(cell.x_m, cell.y_m);
  }
  Path path;
};

std::size_t count_if(const CellMap& map, auto&& predicate) {
  return static_cast<std::size_t>(std::count_if(map.cells().begin(), map.cells().end(), [&](const BoundaryCell& cell) {
    return predicate(Fixture::position(map, cell), cell);
  }));
}

TEST(Segmenter, finds_both_kerbs_and_nothing_on_the_road) {
  Fixture f;
  const Segmentation& seen = f.see({.noise_m = 0.01});
  EXPECT_EQ(count_if(seen.boundary, [](const auto& p, const auto&) { return std::abs(p.y()) < 3.75; }), 0U);
  EXPECT_GT(
      count_if(seen.boundary, [](const auto& p, const auto&) { return std::abs(p.y() - 4.0) < 0.25 && p.norm() < 15; }),
      60U);
  EXPECT_GT(
      count_if(seen.boundary, [](const auto& p, const auto&) { return std::abs(p.y() + 4.0) < 0.25 && p.norm() < 15; }),
      60U);
}

TEST(Segmenter, far_kerbs_show_their_edge_and_say_where_they_do_not) {
  Fixture f;
  const Segmentation& seen = f.see({.noise_m = 0.01});
  const auto far = [](const auto& p) {
    return std::abs(p.x()) > 8 && std::abs(p.x()) < 25 && p.y() > 3.5 && p.y() < 7;
  };
  const auto with_edge = [&](const auto& p, const BoundaryCell& cell) { return far(p) && cell.edge_seen; };
  const auto top_alone = [&](const auto& p, const BoundaryCell& cell) { return far(p) && !cell.edge_seen; };
  EXPECT_GT(count_if(seen.boundary, with_edge), 10U);
  EXPECT_GT(count_if(seen.boundary, top_alone), 10U);
  EXPECT_EQ(count_if(seen.boundary, [&](const auto& p, const auto& c) { return with_edge(p, c) && p.y() > 4.3; }), 0U);
  EXPECT_EQ(count_if(seen.boundary, [&](const auto& p, const auto& c) { return top_alone(p, c) && p.y() < 3.9; }), 0U);
}

TEST(Segmenter, measures_the_kerbs_height) {
  Fixture f;
  const Segmentation& seen = f.see({.kerb_m = 0.15});
  for (const BoundaryCell& cell : seen.boundary.cells()) {
    const Eigen::Vector2d p = Fixture::position(seen.boundary, cell);
    if (std::abs(p.y() - 4.05) < 0.1 && std::abs(p.x()) < 8) {
      EXPECT_NEAR(cell.height_m, 0.15, 0.06);  // rings need not meet the kerb's edge
    }
  }
}

TEST(Segmenter, structure_is_what_stands_tall) {
  Fixture f;
  const Segmentation& seen = f.see({});
  EXPECT_EQ(count_if(seen.structure, [](const auto& p, const auto&) { return std::abs(p.y() - 8.0) > 0.2; }), 0U);
  EXPECT_GT(count_if(seen.structure, [](const auto& p, const auto&) { return std::abs(p.x()) < 10 && p.y() > 0; }),
            80U);
}

TEST(Segmenter, a_slope_of_eight_percent_is_road) {
  Fixture f;
  const Segmentation& seen = f.see({.slope = 0.08, .noise_m = 0.01});
  EXPECT_LT(count_if(seen.boundary, [](const auto& p, const auto&) { return std::abs(p.y()) < 3.7; }), 3U);
  EXPECT_GT(count_if(seen.boundary, [](const auto& p, const auto&) { return std::abs(std::abs(p.y()) - 4.0) < 0.3; }),
            60U);
}

TEST(Segmenter, drops_the_own_body) {
  Fixture f;
  Street street;
  Sweep sweep = street.sweep_from(0, 0, 0);
  for (int i = 0; i < 50; ++i) sweep.returns.push_back({.x_m = 2.0F, .y_m = 0.5F, .z_m = -0.5F});
  f.path.push({0}, {});
  const Segmentation& seen = f.segmenter.run(sweep, f.path);
  EXPECT_EQ(count_if(seen.boundary, [](const auto& p, const auto&) { return p.norm() < 3; }), 0U);
}

TEST(Segmenter, takes_motion_out_of_the_sweep) {
  Fixture f;
  // Driving at 10 m/s past a pole while the sweep is taken: without de-skewing the pole's returns spread over 0.5 m.
  f.path.push({0}, {0, 0, 0});
  f.path.push({100'000'000}, {1.0, 0, 0});
  Sweep sweep;
  sweep.end = {100'000'000};
  for (int i = 0; i < 100; ++i) {
    const double driven_m = 0.5 * i / 100;  // first half of the sweep
    sweep.returns.push_back({.x_m = static_cast<float>(9.1 - driven_m),
                             .y_m = 5.1F,
                             .z_m = static_cast<float>(-1.7 + 0.02 * i),
                             .time_ns = static_cast<std::uint32_t>(500'000 * i)});
  }
  const Segmentation& seen = f.segmenter.run(sweep, f.path);
  ASSERT_EQ(seen.boundary.cells().size(), 1U);
  const Eigen::Vector2d p = Fixture::position(seen.boundary, seen.boundary.cells()[0]);
  EXPECT_NEAR(p.x(), 9.1, 0.01);
  EXPECT_LT(seen.boundary.cells()[0].sigma_m, 0.01F);
}

TEST(Segmenter, ignores_what_is_driven_under) {
  Fixture f;
  Street street;
  Sweep sweep = street.sweep_from(0, 0, 0);
  for (int i = 0; i < 100; ++i)
    sweep.returns.push_back({.x_m = 10.0F, .y_m = 0.02F * static_cast<float>(i), .z_m = 1.5F});
  f.path.push({0}, {});
  const Segmentation& seen = f.segmenter.run(sweep, f.path);
  EXPECT_EQ(count_if(seen.boundary,
                     [](const auto& p, const auto&) { return std::abs(p.x() - 10) < 0.3 && std::abs(p.y()) < 3; }),
            0U);
}

TEST(Segmenter, an_empty_sweep_and_values_far_outside_are_harmless) {
  Fixture f;
  Sweep sweep;
  sweep.returns.push_back({.x_m = 1e30F, .y_m = -1e30F, .z_m = 0});
  sweep.returns.push_back({.x_m = std::nanf(""), .y_m = 0, .z_m = 0});
  sweep.returns.push_back(
      {.x_m = 1, .y_m = 5, .z_m = std::numeric_limits<float>::infinity(), .time_ns = 4'000'000'000U});
  EXPECT_TRUE(f.segmenter.run(sweep, f.path).boundary.cells().empty());
  EXPECT_EQ(f.segmenter.run(Sweep{}, f.path).return_count, 0U);
}

}  // namespace
}  // namespace roadvec
