#include "core/graph/optimise.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace roadvec {
namespace {

Eigen::Matrix3d information(double sigma_m, double sigma_rad) {
  return Eigen::Vector3d(1 / (sigma_m * sigma_m), 1 / (sigma_m * sigma_m), 1 / (sigma_rad * sigma_rad)).asDiagonal();
}

/// A circle of poses whose odometry turns a little too far at each step.
struct Circle {
  std::vector<Pose2> truth;
  PoseGraph graph;
  explicit Circle(std::size_t count = 60, double bias_rad = 0.003) {
    const Pose2 step{2, 0, kTwoPi / static_cast<double>(count)};
    truth.push_back({});
    graph.poses_map.push_back({});
    for (std::size_t k = 1; k < count; ++k) {
      truth.push_back(truth.back() * step);
      const Pose2 measured{step.x_m, step.y_m, step.theta_rad + bias_rad};
      graph.odometry.push_back({k - 1, k, measured, information(0.05, 0.005)});
      graph.poses_map.push_back(graph.poses_map.back() * measured);
    }
  }
  [[nodiscard]] LoopEdge loop(std::size_t from, std::size_t to) const {
    return {{from, to, truth[from].inverse() * truth[to], information(0.03, 0.003)}, true};
  }
  [[nodiscard]] double greatest_error_m() const {
    double greatest = 0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      greatest = std::max(greatest, (truth[k].translation() - graph.poses_map[k].translation()).norm());
    }
    return greatest;
  }
};

TEST(Optimiser, a_loop_takes_the_drift_away) {
  Circle circle;
  EXPECT_GT(circle.greatest_error_m(), 2.0);
  circle.graph.loops.push_back(circle.loop(0, 59));
  const OptimiseReport report = Optimiser{OptimiseConfig{}}.run(circle.graph);
  EXPECT_TRUE(report.solved);
  EXPECT_EQ(report.switched_off_count, 0U);
  EXPECT_LT(circle.greatest_error_m(), 0.05);
  EXPECT_EQ(circle.graph.poses_map[0], Pose2{});
}

TEST(Optimiser, a_false_loop_among_true_ones_is_switched_off_and_does_not_bend_the_map) {
  Circle circle, without;
  for (std::size_t k = 0; k < 5; ++k) circle.graph.loops.push_back(circle.loop(k, 55 + k));
  without.graph.loops = circle.graph.loops;
  LoopEdge wrong = circle.loop(2, 58);
  wrong.edge.T_from_to.x_m += 6;
  circle.graph.loops.push_back(wrong);
  const OptimiseReport report = Optimiser{OptimiseConfig{}}.run(circle.graph);
  EXPECT_TRUE(report.solved);
  EXPECT_EQ(report.switched_off_count, 1U);
  EXPECT_FALSE(circle.graph.loops.back().active);
  EXPECT_EQ(Optimiser{OptimiseConfig{}}.run(without.graph).switched_off_count, 0U);
  for (std::size_t k = 0; k < circle.truth.size(); ++k) {
    EXPECT_LT((circle.graph.poses_map[k].translation() - without.graph.poses_map[k].translation()).norm(), 1e-3);
  }
}

TEST(Optimiser, a_loop_that_was_switched_off_returns_when_others_confirm_it) {
  Circle circle;
  LoopEdge early = circle.loop(2, 58);
  early.active = false;
  circle.graph.loops = {early, circle.loop(0, 56), circle.loop(1, 57)};
  static_cast<void>(Optimiser{OptimiseConfig{}}.run(circle.graph));
  EXPECT_TRUE(circle.graph.loops.front().active);
}

TEST(Optimiser, a_solve_that_fails_leaves_poses_and_loops_as_they_were) {
  Circle circle;
  circle.graph.loops = {circle.loop(0, 30), circle.loop(2, 58)};
  circle.graph.loops.front().active = false;
  circle.graph.loops.back().edge.T_from_to.x_m = std::numeric_limits<double>::quiet_NaN();
  const PoseGraph before = circle.graph;
  const OptimiseReport report = Optimiser{OptimiseConfig{}}.run(circle.graph);
  EXPECT_FALSE(report.solved);
  EXPECT_EQ(report.switched_off_count, 1U);
  EXPECT_EQ(circle.graph.poses_map, before.poses_map);
  EXPECT_FALSE(circle.graph.loops.front().active);
  EXPECT_TRUE(circle.graph.loops.back().active);
}

TEST(Optimiser, a_loop_that_saw_one_direction_only_leaves_the_other_to_odometry) {
  // Straight drive; the loop says something about y and nothing about x.
  PoseGraph graph;
  graph.poses_map.push_back({});
  for (std::size_t k = 1; k <= 10; ++k) {
    graph.odometry.push_back({k - 1, k, {2, 0.05, 0}, information(0.1, 0.01)});
    graph.poses_map.push_back(graph.poses_map.back() * graph.odometry.back().T_from_to);
  }
  Eigen::Matrix3d across = information(0.02, 0.002);
  across(0, 0) = 0;
  graph.loops.push_back({{0, 10, {17, 0, 0}, across}, true});
  const OptimiseReport report = Optimiser{OptimiseConfig{}}.run(graph);
  EXPECT_TRUE(report.solved);
  EXPECT_NEAR(graph.poses_map.back().x_m, 20.0, 0.05);
  EXPECT_NEAR(graph.poses_map.back().y_m, 0.0, 0.02);
}

TEST(Optimiser, between_nodes_the_poses_are_those_of_a_solve_for_every_keyframe) {
  Circle few, all;
  for (Circle* circle : {&few, &all}) circle->graph.loops = {circle->loop(0, 56), circle->loop(3, 59)};
  const OptimiseReport of_few = Optimiser{OptimiseConfig{}}.run(few.graph);
  const OptimiseReport of_all = Optimiser{OptimiseConfig{.node_spacing_m = 1.0}}.run(all.graph);
  EXPECT_LE(of_few.node_count, 8U);
  EXPECT_EQ(of_all.node_count, 60U);
  EXPECT_GT(Circle().greatest_error_m(), 2.0);
  for (std::size_t k = 0; k < few.truth.size(); ++k) {
    const Pose2 apart = few.graph.poses_map[k].inverse() * all.graph.poses_map[k];
    EXPECT_LT(apart.translation().norm(), 0.05) << k;  // of corrections of some metres
    EXPECT_LT(std::abs(apart.theta_rad), 2e-3) << k;
  }
}

TEST(Optimiser, keyframes_before_the_first_that_may_move_stay_and_the_others_close_the_loop) {
  Circle circle;
  const std::vector<Pose2> before = circle.graph.poses_map;
  circle.graph.loops = {circle.loop(10, 58), circle.loop(11, 59), circle.loop(2, 20)};
  const OptimiseReport report = Optimiser{OptimiseConfig{}}.run(circle.graph, 30);
  EXPECT_TRUE(report.solved);
  EXPECT_LE(report.node_count, 5U);
  for (std::size_t k = 0; k < 30; ++k) EXPECT_EQ(circle.graph.poses_map[k], before[k]) << k;
  EXPECT_LT(edge_error_sigma(circle.graph, circle.graph.loops[0].edge), 3.0);
  EXPECT_GT((circle.graph.poses_map[59].translation() - before[59].translation()).norm(), 0.5);
}

TEST(Optimiser, the_same_graph_gives_the_same_bytes) {
  Circle once, again;
  for (std::size_t k = 0; k < 5; ++k) {
    once.graph.loops.push_back(once.loop(k, 55 + k));
    again.graph.loops.push_back(again.loop(k, 55 + k));
  }
  static_cast<void>(Optimiser{OptimiseConfig{}}.run(once.graph));
  static_cast<void>(Optimiser{OptimiseConfig{}}.run(again.graph));
  EXPECT_EQ(once.graph.poses_map, again.graph.poses_map);
}

TEST(Optimiser, without_edges_there_is_nothing_to_do) {
  PoseGraph graph;
  EXPECT_FALSE(Optimiser{OptimiseConfig{}}.run(graph).solved);
}

}  // namespace
}  // namespace roadvec
