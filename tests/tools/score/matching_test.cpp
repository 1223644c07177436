#include "tools/score/matching.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/score/boundaries.h"
#include "tools/score/icp.h"

namespace roadvec {
namespace {

/// Frames along x that all see the same lines of the map frame.
std::vector<MatchFrame> frames_of(const std::vector<std::vector<Eigen::Vector2d>>& polylines,
                                  const std::vector<double>& ways_m) {
  LineSet world;
  for (const auto& points : polylines) {
    world.begin_line({.kind = BoundaryKind::curb});
    for (const Eigen::Vector2d& p : points) world.push_vertex({.x_m = p.x(), .y_m = p.y()});
  }
  std::vector<MatchFrame> frames;
  for (const double way_m : ways_m) {
    MatchFrame frame{
        .T_map_vehicle = {way_m, 0, 0.01 * way_m}, .way_m = way_m, .points = {}, .sweep = {}, .raw_lvm = {}, .lvm = {}};
    frame.lvm = frame.raw_lvm = frame.sweep = moved(world, frame.T_map_vehicle.inverse());
    for (const LineSample& s : sample(frame.lvm, 0.5)) frame.points.push_back(s.position_m);
    frames.push_back(frame);
  }
  return frames;
}

const std::vector<std::vector<Eigen::Vector2d>> kCorner{
    {{-30, 5}, {30, 5}}, {{30, -5}, {12, -5}, {10, -7}, {10, -30}}, {{4, -30}, {4, -7}, {2, -5}, {-30, -5}}};
const std::vector<std::vector<Eigen::Vector2d>> kStraight{{{-60, 5}, {60, 5}}, {{60, -5}, {-60, -5}}};
const std::vector<double> kEvery80cm{0, 0.8, 1.6, 2.4, 3.2, 4.0};

const MatchingScore& of(const MatchingScores& scores, MatchMethod method) {
  return scores.methods[static_cast<std::size_t>(method)].value();
}

TEST(Matching, of_lines_that_show_everything_ends_at_the_truth_from_every_start) {
  const auto frames = frames_of(kCorner, kEvery80cm);
  const MatchingScores scores = score_matching(frames, every_pair(frames), 20, {});
  EXPECT_NEAR(scores.distance_mean_m, 0.8, 1e-9);
  for (const MatchMethod method : {MatchMethod::sweep, MatchMethod::raw_lvm, MatchMethod::lvm}) {
    const MatchingScore& score = of(scores, method);
    EXPECT_EQ(score.count, 100U);
    EXPECT_LT(score.mean_m, 0.02);
    EXPECT_NEAR(score.relative_percent, 100 * score.mean_m / 0.8, 1e-6);
    EXPECT_LT(score.heading_mean_deg, 0.1);
    EXPECT_EQ(score.lost_percent, 0);
    EXPECT_EQ(score.refused_percent, 0);
    EXPECT_EQ(score.unobserved_percent, 0);
  }
  const auto& icp_score = scores.methods[static_cast<std::size_t>(MatchMethod::icp)];
  EXPECT_EQ(icp_score.has_value(), icp_is_built());
  EXPECT_LT(icp_score.value_or(MatchingScore{}).mean_m, 0.2) << "points of the two lie half a metre apart";
}

TEST(Matching, on_a_straight_road_keeps_the_starts_error_along_it_and_says_so) {
  const auto frames = frames_of(kStraight, kEvery80cm);
  const MatchingScore score = of(score_matching(frames, every_pair(frames), 30, {}), MatchMethod::lvm);
  EXPECT_EQ(score.unobserved_percent, 100);
  EXPECT_LT(score.across_mean_m, 0.03);
  EXPECT_NEAR(score.along_mean_m, 0.25, 0.05) << "mean of what is even in +-0.5";
}

TEST(Matching, that_is_refused_counts_with_its_starts_error) {
  auto frames = frames_of(kCorner, {0, 0.8});
  frames[1].lvm.clear();
  const MatchingScore score = of(score_matching(frames, every_pair(frames), 200, {}), MatchMethod::lvm);
  EXPECT_EQ(score.refused_percent, 100);
  EXPECT_NEAR(score.along_mean_m, 0.25, 0.04);
  EXPECT_NEAR(score.across_mean_m, 0.25, 0.04);
  EXPECT_NEAR(score.heading_mean_deg, 1.5, 0.2);
  EXPECT_GT(score.lost_percent, 5) << "the corners of the square of starts";
}

TEST(Pairs, lie_as_near_to_80_cm_apart_as_the_sweeps_allow) {
  const auto frames = frames_of(kStraight, {0, 0, 0.3, 0.7, 1.0, 1.6, 5, 5.1, 5.15});
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const FramePair& pair : every_pair(frames)) pairs.emplace_back(pair.reference, pair.moved);
  const std::vector<std::pair<std::size_t, std::size_t>> expected{{0, 3}, {2, 4}, {3, 5}, {4, 5}};
  EXPECT_EQ(pairs, expected) << "none from where the car stood, or to where no sweep is near";
}

TEST(Pairs, of_a_chain_begin_where_the_last_ended_in_the_middle_of_the_drive) {
  std::vector<double> ways_m;
  for (int i = 0; i <= 100; ++i) ways_m.push_back(0.4 * i);
  const auto frames = frames_of(kStraight, ways_m);
  const std::vector<FramePair> chain = chain_of_pairs(frames, 8);
  ASSERT_EQ(chain.size(), 8U);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    EXPECT_EQ(chain[i].reference, chain[0].reference + 2 * i);
    EXPECT_EQ(chain[i].moved, chain[i].reference + 2);
  }
  EXPECT_NEAR(0.5 * (frames[chain.front().reference].way_m + frames[chain.back().moved].way_m), 20, 0.5);
  EXPECT_LT(chain_of_pairs({frames.begin(), frames.begin() + 5}, 8).size(), 8U);
  EXPECT_TRUE(chain_of_pairs({}, 8).empty());
}

}  // namespace
}  // namespace roadvec
