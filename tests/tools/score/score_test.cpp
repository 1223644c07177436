#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "tests/support/temporary_folder.h"
#include "tools/score/boundary_score.h"
#include "tools/score/score.h"
#include "tools/score/surveyed_kerbs.h"
#include "tools/score/trajectory.h"
#include "tools/score/visibility.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

constexpr Anchor kAnchor{49.0, 8.4, 112.0, 0.0};

LineSet lines(const std::vector<std::vector<Eigen::Vector2d>>& polylines, BoundaryKind kind = BoundaryKind::curb) {
  LineSet set;
  for (const auto& points : polylines) {
    set.begin_line({.kind = kind});
    for (const Eigen::Vector2d& p : points) set.push_vertex({.x_m = p.x(), .y_m = p.y()});
  }
  return set;
}

/// A bend: 60 m east, then 40 m north.
LineSet bend(double shift_m = 0) {
  return lines({{{0, shift_m}, {60 + shift_m, shift_m}, {60 + shift_m, 40 + shift_m}}});
}

BoundaryScore score_all(const LineSet& map, const LineSet& truth) {
  const auto samples = sample(truth, kSampleSpacing_m);
  return score_boundaries(map, sample(map, kSampleSpacing_m), truth, samples, std::vector<bool>(samples.size(), true));
}

double f1_at(const BoundaryScore& score, double tolerance_m) {
  for (std::size_t t = 0; t < kTolerances_m.size(); ++t) {
    if (kTolerances_m[t] == tolerance_m) return score.kinds.front().f1[t];
  }
  return -1;
}

TEST(BoundaryScore, of_the_truth_itself_is_perfect) {
  const BoundaryScore score = score_all(bend(), bend());
  for (const double tolerance_m : kTolerances_m) EXPECT_EQ(f1_at(score, tolerance_m), 1.0);
  EXPECT_NEAR(*score.lateral_95_m, 0, 1e-9);
  EXPECT_EQ(score.duplicated_percent, 0);
  EXPECT_EQ(score.break_count, 0U);
  EXPECT_NEAR(score.kinds.front().map_m, 100, 1e-6);
}

class ShiftedMap : public testing::TestWithParam<double> {};
TEST_P(ShiftedMap, scores_its_shift) {
  const double d_m = GetParam();
  const BoundaryScore score = score_all(lines({{{0, d_m}, {60, d_m}}}), lines({{{-5, 0}, {65, 0}}}));
  EXPECT_NEAR(*score.lateral_median_m, d_m, 1e-9);
  EXPECT_NEAR(*score.lateral_mean_m, d_m, 1e-9);
  for (std::size_t t = 0; t < kTolerances_m.size(); ++t) {
    EXPECT_EQ(score.kinds.front().precision[t], kTolerances_m[t] >= d_m ? 1.0 : 0.0) << kTolerances_m[t];
  }
}
INSTANTIATE_TEST_SUITE_P(By, ShiftedMap, testing::Values(0.03, 0.07, 0.15, 0.25, 0.4));

TEST(BoundaryScore, of_a_map_that_lacks_a_metre_lacks_a_metre_of_recall_and_shows_the_break) {
  const BoundaryScore score = score_all(lines({{{0, 0}, {40, 0}}, {{41, 0}, {100, 0}}}), lines({{{0, 0}, {100, 0}}}));
  EXPECT_NEAR(score.kinds.front().recall.front(), 0.991, 0.002);  // both ends reach 5 cm into the gap
  EXPECT_EQ(score.kinds.front().precision.front(), 1.0);
  EXPECT_EQ(score.break_count, 1U);
  EXPECT_NEAR(score.breaks_per_100m, 1.0, 1e-9);
}

TEST(BoundaryScore, finds_a_line_that_is_there_twice) {
  const BoundaryScore score =
      score_all(lines({{{0, 0}, {100, 0}}, {{30, 0.1}, {70, 0.1}}}), lines({{{0, 0}, {100, 0}}}));
  EXPECT_NEAR(score.duplicated_percent, 40, 1.5);
  EXPECT_EQ(score.break_count, 0U);
}

TEST(BoundaryScore, keeps_the_kinds_apart_and_counts_them_together) {
  const LineSet map = lines({{{0, 0}, {50, 0}}}, BoundaryKind::barrier), truth = lines({{{0, 0}, {50, 0}}});
  const BoundaryScore score = score_all(map, truth);
  ASSERT_EQ(score.kinds.size(), 3U);
  EXPECT_EQ(score.kinds[0].f1.back(), 1.0);
  EXPECT_EQ(score.kinds[1].kind, "curb");
  EXPECT_EQ(score.kinds[1].recall.back(), 0.0);
  EXPECT_EQ(score.kinds[2].kind, "barrier");
  EXPECT_EQ(score.kinds[2].precision.back(), 0.0);
}

TEST(BoundaryScore, does_not_ask_for_what_was_not_visible) {
  const LineSet truth = lines({{{0, 0}, {50, 0}}, {{0, 20}, {50, 20}}});
  const auto samples = sample(truth, kSampleSpacing_m);
  std::vector<bool> visible(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) visible[i] = samples[i].line == 0;
  const LineSet map = lines({{{0, 0}, {50, 0}}});
  const BoundaryScore score = score_boundaries(map, sample(map, kSampleSpacing_m), truth, samples, visible);
  EXPECT_EQ(score.kinds.front().recall.front(), 1.0);
  EXPECT_NEAR(score.truth_total_m, 100, 1e-6);
}

TEST(BoundaryScore, does_not_count_what_lies_on_a_line_that_may_be_mapped_or_not) {
  Boundaries truth;
  truth.lines = lines({{{0, 0}, {50, 0}}});
  truth.optional_lines = lines({{{50, 0}, {80, 0}}, {{0, 0.3}, {50, 0.3}}});
  const LineSet map = lines({{{0, 0.1}, {80, 0.1}}, {{0, 10}, {20, 10}}});
  EXPECT_NEAR(length_m(samples_that_count(map, truth)), 50 + 20, 0.6) << "on the kerb, and what lies on nothing";
  truth.optional_lines = {};
  EXPECT_NEAR(length_m(samples_that_count(map, truth)), 80 + 20, 1e-6);
}

TEST(BoundaryScore, of_an_empty_map_finds_nothing) {
  const BoundaryScore score = score_all(LineSet{}, bend());
  EXPECT_EQ(score.kinds.front().recall.back(), 0.0);
  EXPECT_FALSE(score.lateral_median_m);
}

TEST(Visible, is_what_the_sensor_saw_from_near_and_what_no_other_boundary_hides) {
  Boundaries truth;
  truth.lines = lines({{{-50, 5}, {50, 5}}, {{-50, 8}, {50, 8}}, {{-50, -5}, {50, -5}}, {{-50, -30}, {50, -30}}});
  constexpr double kNever = std::numeric_limits<double>::infinity();
  truth.seen_within_m = {10, 10, kNever, 40};
  const auto samples = sample(truth.lines, kSampleSpacing_m);
  const std::vector<bool> flags = visible(samples, truth, {{0, {-20, 0, 0}}, {1, {0, 0, 0}}, {2, {20, 0, 0}}}, 40);
  std::array<double, 4> seen_m{};
  for (std::size_t i = 0; i < samples.size(); ++i) seen_m[samples[i].line] += flags[i] ? samples[i].length_m : 0;
  EXPECT_GT(seen_m[0], 95);
  EXPECT_EQ(seen_m[1], 0) << "behind the first";
  EXPECT_EQ(seen_m[2], 0) << "never seen by the sensor";
  EXPECT_EQ(seen_m[3], 0) << "behind the third";
}

Trajectory quarter_circle(const Pose2& start) {
  Trajectory way;
  for (int i = 0; i <= 100; ++i) {
    const double angle_rad = 0.01 * i * kPi / 2;
    way.push_back({0.1 * i, start * Pose2{50 * std::sin(angle_rad), 50 - 50 * std::cos(angle_rad), angle_rad}});
  }
  return way;
}

TEST(TrajectoryScore, of_the_truth_itself_is_perfect_in_any_frame) {
  const Expected<TrajectoryScore> score = score_trajectory(quarter_circle({3, -7, 0.4}), quarter_circle({}));
  ASSERT_TRUE(score);
  EXPECT_NEAR(score->from_start.max_m, 0, 1e-9);
  EXPECT_NEAR(score->aligned.max_m, 0, 1e-9);
  EXPECT_NEAR(*score->rpe_percent_per_10m, 0, 1e-9);
  EXPECT_NEAR(score->way_m, 25 * kPi, 0.01);
}

TEST(TrajectoryScore, from_the_start_shows_a_wrong_first_heading_that_the_best_fit_takes_away) {
  Trajectory ours = quarter_circle({});
  for (std::size_t i = 1; i < ours.size(); ++i) ours[i].T_map_vehicle = Pose2{0, 0, 0.01} * ours[i].T_map_vehicle;
  const Expected<TrajectoryScore> score = score_trajectory(ours, quarter_circle({}));
  ASSERT_TRUE(score);
  EXPECT_NEAR(score->from_start.max_m, 0.01 * 50 * std::sqrt(2.0), 1e-3);
  EXPECT_LT(score->aligned.max_m, 1e-9);
}

TEST(TrajectoryScore, tells_a_scale_error_as_relative_error) {
  Trajectory ours = quarter_circle({});
  for (StampedPose& pose : ours) {
    pose.T_map_vehicle.x_m *= 1.02;
    pose.T_map_vehicle.y_m *= 1.02;
  }
  const Expected<TrajectoryScore> score = score_trajectory(ours, quarter_circle({}));
  ASSERT_TRUE(score);
  EXPECT_NEAR(*score->rpe_percent_per_10m, 2, 0.02);
}

TEST(TrajectoryScore, refuses_drives_of_different_times) {
  Trajectory later = quarter_circle({});
  for (StampedPose& pose : later) pose.t_s += 1000;
  const Expected<TrajectoryScore> score = score_trajectory(later, quarter_circle({}));
  ASSERT_FALSE(score);
  EXPECT_THAT(score.error().message, HasSubstr("same drive"));
}

TEST(MapSize, is_told_per_kilometre_driven) {
  MapSize size;
  EXPECT_FALSE(size.per_km(1000));
  size.driven_m = 250;
  EXPECT_NEAR(*size.per_km(1000), 4000, 1e-9);
}

TEST(SurveyedKerbs, are_met_after_the_shift_between_the_two_references) {
  const LineSet kerbs = lines({{{0, 0}, {60, 0}}, {{60, 0}, {60, 40}}});
  const Expected<SurveyedKerbScore> score = score_surveyed_kerbs(bend(0.8), kerbs);
  ASSERT_TRUE(score);
  EXPECT_NEAR(score->shift_m.x(), -0.8, 0.03);
  EXPECT_NEAR(score->shift_m.y(), -0.8, 0.03);
  EXPECT_LT(*score->median_m, 0.03);
  EXPECT_NEAR(score->with_counterpart_m, score->curb_m, 1e-6);
}

class Files : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path write(const char* name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  TemporaryFolder folder_;
};

TEST_F(Files, of_truth_say_kind_and_from_how_near_a_line_was_seen) {
  const auto file = write("truth.geojson", R"({"type":"FeatureCollection","features":[
    {"type":"Feature","properties":{"kind":"curb","seen_within_m":20},"geometry":{"type":"LineString","coordinates":[[8.4,49],[8.401,49]]}},
    {"type":"Feature","properties":{"kind":"barrier","seen_within_m":null},"geometry":{"type":"LineString","coordinates":[[8.4,49,112],[8.4,49.001]]}}]})");
  const auto truth = load_truth(file, kAnchor);
  ASSERT_TRUE(truth) << truth.error().message;
  ASSERT_EQ(truth->lines.lines().size(), 2U);
  EXPECT_EQ(truth->lines.lines()[1].attributes.kind, BoundaryKind::barrier);
  EXPECT_EQ(truth->seen_within_m[0], 20);
  EXPECT_TRUE(std::isinf(truth->seen_within_m[1]));
  EXPECT_NEAR(length_m(sample(truth->lines, 0.1)), 73.2 + 111.2, 0.2);
}

TEST_F(Files, of_truth_say_what_may_be_mapped_or_not_and_maps_have_nothing_of_the_kind) {
  const auto file = write("truth.geojson", R"({"type":"FeatureCollection","features":[
    {"properties":{"kind":"curb","height_m":0.12},"geometry":{"type":"LineString","coordinates":[[8.4,49],[8.401,49]]}},
    {"properties":{"kind":"curb","height_m":0.03},"geometry":{"type":"LineString","coordinates":[[8.4,49],[8.401,49]]}},
    {"properties":{"kind":"unknown","height_m":0},"geometry":{"type":"LineString","coordinates":[[8.4,49],[8.401,49]]}},
    {"properties":{"kind":"barrier","height_m":2,"removed":true},"geometry":{"type":"LineString","coordinates":[[8.4,49],[8.401,49]]}},
    {"properties":{"kind":"barrier"},"geometry":{"type":"LineString","coordinates":[[8.4,49],[8.401,49]]}}]})");
  const auto truth = load_truth(file, kAnchor);
  ASSERT_TRUE(truth) << truth.error().message;
  EXPECT_EQ(truth->lines.lines().size(), 2U);
  EXPECT_EQ(truth->seen_within_m.size(), 2U);
  EXPECT_EQ(truth->optional_lines.lines().size(), 3U);
  const auto map = load_map(file, kAnchor);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->lines.lines().size(), 5U);
}

TEST_F(Files, that_are_damaged_are_named_with_place_and_remedy) {
  const auto cut = load_map(write("cut.geojson", R"({"features":[{"geometry":)"), kAnchor);
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.error().message, HasSubstr("cut.geojson"));
  const auto nowhere =
      load_map(write("nowhere.geojson",
                     R"({"features":[{"properties":{},"geometry":{"type":"LineString","coordinates":[[8.4,490]]}}]})"),
               kAnchor);
  ASSERT_FALSE(nowhere);
  EXPECT_THAT(nowhere.error().message, HasSubstr("feature 1: a position that is not on Earth"));
  EXPECT_FALSE(load_map(folder_ / "absent.geojson", kAnchor));

  const auto tum = load_tum(write("bad.tum", "# t x y z qx qy qz qw\n1 2 3 0 0 0 0 1\n2 3 four 0 0 0 0 1\n"));
  ASSERT_FALSE(tum);
  EXPECT_THAT(tum.error().message, HasSubstr("bad.tum:3:"));
  EXPECT_FALSE(load_tum(write("empty.tum", "")));
  EXPECT_FALSE(load_tum(write("back.tum", "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n")));

  EXPECT_FALSE(load_curbstones(write("no.osm", "<osm/>"), kAnchor));
  EXPECT_FALSE(load_curbstones(write("broken.osm", "<osm><way"), kAnchor));
}

}  // namespace
}  // namespace roadvec
