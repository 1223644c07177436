#include "core/graph/close_loop.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/support/worlds.h"

namespace roadvec {
namespace {

using worlds::Points;
using worlds::View;
using worlds::World;

/// A drive through the crossing from the left, round a block that is not drawn, and through it again.
struct Revisit {
  PoseGraph graph;
  std::vector<KeptKeyframe> keyframes;

  /// `offset`: how far the odometry is off on the second pass; `sigma_m`: what it claims to be.
  Revisit(const World& world, const Pose2& offset, double sigma_m, bool backwards = false,
          const World* second_world = nullptr) {
    std::mt19937_64 random(1);
    const View view{.noise_m = 0.02};
    add_pass(world, {0, 0, 0}, random, view, 0.0, sigma_m, backwards, false);
    add_pass(second_world != nullptr ? *second_world : world, offset, random, view, 200.0, sigma_m, backwards, true);
  }

  std::size_t feed(LoopCloser& closer) {
    std::size_t accepted = 0;
    PoseGraph growing;
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      growing.poses_map.push_back(graph.poses_map[k]);
      growing.travelled_m.push_back(graph.travelled_m[k]);
      if (k > 0) growing.odometry.push_back(graph.odometry[k - 1]);
      for (const PoseEdge& edge : closer.run(growing, std::span(keyframes).first(k + 1))) {
        edges.push_back(edge);
        ++accepted;
      }
    }
    return accepted;
  }
  std::vector<PoseEdge> edges;
  std::vector<Pose2> truth;

 private:
  void add_pass(const World& world, const Pose2& offset, std::mt19937_64& random, const View& view, double from_m,
                double sigma_m, bool backwards, bool second) {
    for (int k = 0; k < 10; ++k) {
      const bool turned = backwards && second;
      const double x = turned ? 10.0 - 2.0 * k : -10.0 + 2.0 * k;
      const Pose2 true_pose{x, turned ? 1.5 : -1.5, turned ? kPi : 0.0};
      const Pose2 believed = offset * true_pose;
      if (!graph.poses_map.empty()) {
        // All of the uncertainty is gathered on the way between the passes.
        const double step_m = second && k == 0 ? sigma_m : 0.002;
        const double step_rad = second && k == 0 ? 0.01 : 0.0002;
        const Eigen::Matrix3d information =
            Eigen::Vector3d(1 / (step_m * step_m), 1 / (step_m * step_m), 1 / (step_rad * step_rad)).asDiagonal();
        graph.odometry.push_back(
            {truth.size() - 1, truth.size(), graph.poses_map.back().inverse() * believed, information});
      }
      graph.poses_map.push_back(believed);
      graph.travelled_m.push_back(from_m + 2.0 * k);
      truth.push_back(true_pose);
      keyframes.push_back({{}, believed, PackedLines(worlds::seen_from(world, true_pose, view, random)), {}});
    }
  }
};

void expect_true(const Revisit& revisit) {
  for (const PoseEdge& edge : revisit.edges) {
    const Pose2 truth = revisit.truth[edge.from].inverse() * revisit.truth[edge.to];
    EXPECT_LT((edge.T_from_to.translation() - truth.translation()).norm(), 0.08) << edge.from << " to " << edge.to;
    EXPECT_LT(std::abs(wrap_rad(edge.T_from_to.theta_rad - truth.theta_rad)), 0.01);
  }
}

TEST(LoopCloser, a_place_seen_before_is_found_once_several_matches_agree) {
  Revisit revisit(worlds::crossing(), {0.8, -0.6, 0.01}, 1.0);
  LoopCloser closer{CloseLoopConfig{.sure_every_m = 0.0}, MatchConfig{}};
  EXPECT_GE(revisit.feed(closer), 8U);
  expect_true(revisit);
  EXPECT_EQ(closer.report().attempt_count, 20U);
  EXPECT_EQ(closer.report().no_candidate_count, 10U);
}

TEST(LoopCloser, while_loops_are_accepted_fewer_are_tried) {
  Revisit revisit(worlds::crossing(), {0.8, -0.6, 0.01}, 1.0);
  LoopCloser closer{CloseLoopConfig{.sure_every_m = 4.0}, MatchConfig{}};
  EXPECT_GE(revisit.feed(closer), 5U);
  expect_true(revisit);
  EXPECT_LT(closer.report().attempt_count, 20U);
}

TEST(LoopCloser, a_place_that_is_passed_again_and_again_is_looked_at_no_more_often) {
  // The same ten places over and over: what an attempt looks at must not grow with the passes.
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  PoseGraph graph;
  std::vector<KeptKeyframe> keyframes;
  std::uint64_t in_second_pass = 0, in_last_pass = 0;
  for (std::size_t pass = 0; pass < 8; ++pass) {
    const std::uint64_t before = closer.report().looked_at_count;
    for (std::size_t k = 0; k < 10; ++k) {
      if (!graph.poses_map.empty()) {
        const Pose2 pose{2.0 * static_cast<double>(k), 0, 0};
        graph.odometry.push_back({keyframes.size() - 1, keyframes.size(), graph.poses_map.back().inverse() * pose,
                                  Eigen::Vector3d(1e4, 1e4, 1e6).asDiagonal()});
      }
      graph.poses_map.push_back({2.0 * static_cast<double>(k), 0, 0});
      graph.travelled_m.push_back(200.0 * static_cast<double>(pass) + 2.0 * static_cast<double>(k));
      keyframes.push_back({{}, graph.poses_map.back(), {}, {}});
      static_cast<void>(closer.run(graph, keyframes));
    }
    in_last_pass = closer.report().looked_at_count - before;
    if (pass == 1) in_second_pass = in_last_pass;
  }
  EXPECT_GT(in_second_pass, 0U);
  EXPECT_EQ(in_last_pass, in_second_pass);
}

TEST(LoopCloser, the_other_driving_direction_closes_too) {
  Revisit revisit(worlds::crossing(), {0.8, -0.6, 0.01}, 1.0, true);
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  EXPECT_GE(revisit.feed(closer), 6U);
  expect_true(revisit);
}

TEST(LoopCloser, several_starts_find_a_place_that_one_start_would_miss) {
  Revisit revisit(worlds::crossing(), {4.0, 3.0, 0.02}, 2.5);
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  EXPECT_GE(revisit.feed(closer), 3U);
  expect_true(revisit);
  CloseLoopConfig one;
  one.max_starts_per_side = 0;
  Revisit same(worlds::crossing(), {4.0, 3.0, 0.02}, 2.5);
  LoopCloser single{one, MatchConfig{}};
  EXPECT_EQ(same.feed(single), 0U);
}

TEST(LoopCloser, what_contradicts_a_sure_odometry_is_refused) {
  Revisit revisit(worlds::crossing(), {1.0, -0.8, 0.0}, 0.05);
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  EXPECT_EQ(revisit.feed(closer), 0U);
  EXPECT_GE(closer.report().contradicts_odometry_count, 8U);
}

TEST(LoopCloser, a_row_of_equal_doors_is_ambiguous) {
  // Bays every 3 m: shifted by one it fits as well.
  World row;
  Points left{{-60, 4}};
  for (double x = -57; x < 57; x += 3) {
    for (const Eigen::Vector2d& p :
         {Eigen::Vector2d(x, 4), Eigen::Vector2d(x, 5), Eigen::Vector2d(x + 1.5, 5), Eigen::Vector2d(x + 1.5, 4)}) {
      left.push_back(p);
    }
  }
  row.push_back(left);
  row.push_back({{60, -4}, {-60, -4}});
  Revisit revisit(row, {0.5, 0.3, 0}, 1.5);
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  EXPECT_EQ(revisit.feed(closer), 0U);
  EXPECT_GE(closer.report().ambiguous_count, 8U);
}

TEST(LoopCloser, another_street_at_the_same_place_is_no_loop_and_the_reason_is_counted) {
  const World other{{{-30, 9}, {-5, 2}, {30, 12}}, {{30, -3}, {-8, -7}, {-30, -2}}};
  Revisit revisit(worlds::crossing(), {0, 0, 0}, 0.3, false, &other);
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  EXPECT_EQ(revisit.feed(closer), 0U);
  const CloseLoopReport& r = closer.report();
  EXPECT_EQ(r.attempt_count, r.no_candidate_count + r.too_few_lines_count + r.poor_overlap_count + r.poor_fit_count +
                                 r.diverged_count + r.ambiguous_count + r.contradicts_odometry_count + r.waiting_count +
                                 r.accepted_count);
}

TEST(LoopCloser, a_straight_street_gives_loops_that_say_nothing_along_it) {
  Revisit revisit(worlds::straight_street(-60, 60), {0.7, 0.4, 0.005}, 0.5);
  LoopCloser closer{CloseLoopConfig{}, MatchConfig{}};
  ASSERT_GE(revisit.feed(closer), 3U);
  for (const PoseEdge& edge : revisit.edges) {
    EXPECT_LT(edge.information(0, 0), 1.0);
    EXPECT_GT(edge.information(1, 1), 100.0);
    const Pose2 truth = revisit.truth[edge.from].inverse() * revisit.truth[edge.to];
    EXPECT_NEAR(edge.T_from_to.y_m, truth.y_m, 0.06);
  }
}

TEST(PackedLines, keep_positions_to_a_millimetre_and_attributes_exactly) {
  std::mt19937_64 random(1);
  const LineSet lines = worlds::seen_from(worlds::crossing(), {1, 2, 0.3}, {.noise_m = 0.03}, random);
  LineSet unpacked;
  PackedLines(lines).append_to(unpacked);
  ASSERT_EQ(unpacked.vertices().size(), lines.vertices().size());
  ASSERT_EQ(unpacked.lines().size(), lines.lines().size());
  for (std::size_t i = 0; i < lines.vertices().size(); ++i) {
    EXPECT_LT((unpacked.vertices()[i].position() - lines.vertices()[i].position()).norm(), 0.0015);
    EXPECT_NEAR(unpacked.vertices()[i].height_m, lines.vertices()[i].height_m, 0.0006);
    EXPECT_NEAR(unpacked.vertices()[i].sigma_across_m, lines.vertices()[i].sigma_across_m, 0.0011);
  }
  for (std::size_t l = 0; l < lines.lines().size(); ++l) EXPECT_EQ(unpacked.lines()[l], lines.lines()[l]);
}

}  // namespace
}  // namespace roadvec
