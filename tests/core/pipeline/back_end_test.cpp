#include "core/pipeline/back_end.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/geometry/segment.h"
#include "tests/support/worlds.h"

namespace roadvec {
namespace {

using worlds::Drift;
using worlds::Points;
using worlds::View;
using worlds::World;

double distance_to_world_m(const Eigen::Vector2d& p, const World& world) {
  double best = 1e9;
  for (const Points& line : world) {
    for (std::size_t i = 1; i < line.size(); ++i) best = std::min(best, Segment{line[i - 1], line[i]}.distance2_m2(p));
  }
  return std::sqrt(best);
}

double length_m(const World& world) {
  double sum_m = 0;
  for (const Points& line : world) {
    for (std::size_t i = 1; i < line.size(); ++i) sum_m += (line[i] - line[i - 1]).norm();
  }
  return sum_m;
}

/// Once around the block and a bit further, from the middle of the lower street.
std::vector<Pose2> lap_and_more() {
  return worlds::drive_along({{30, -1.5}, {111.5, -1.5}, {111.5, 71.5}, {-1.5, 71.5}, {-1.5, -1.5}, {100, -1.5}});
}

/// Once around, then about in the street and back the other way.
std::vector<Pose2> lap_and_back() {
  std::vector<Pose2> poses = worlds::drive_along({{30, -1.5}, {111.5, -1.5}, {111.5, 71.5}, {-1.5, 71.5}, {-1.5, 10}});
  for (int k = 1; k < 9; ++k) poses.push_back({-1.5 + 0.3 * k, 9.5, -kPi / 2 + k * kPi / 8});
  const std::vector<Pose2> back = worlds::drive_along({{1.5, 10}, {1.5, 68.5}, {100, 68.5}});
  poses.insert(poses.end(), back.begin(), back.end());
  return poses;
}

struct Errors {
  double mean_m = 0, greatest_m = 0;
};
Errors errors(std::span<const TrajectoryPoint> trajectory, const std::vector<Pose2>& truth) {
  Errors result;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const double error_m = (trajectory[k].T_map_vehicle.translation() - truth[k].translation()).norm();
    result.mean_m += error_m / static_cast<double>(truth.size());
    result.greatest_m = std::max(result.greatest_m, error_m);
  }
  return result;
}

/// Runs a drive; a client's copy follows by the changes alone and must equal the map all the way.
class Mapping {
 public:
  Mapping(const std::vector<Keyframe>& keyframes, const Pose2& T_map_odom_start = {})
      : back_end_(PipelineConfig{}, T_map_odom_start, probe_) {
    for (const Keyframe& keyframe : keyframes) follow(back_end_.add(keyframe));
    follow(back_end_.finish());
  }
  [[nodiscard]] const BackEnd& back_end() const { return back_end_; }
  [[nodiscard]] int closed_loop_count() const { return closed_loop_count_; }

 private:
  void follow(const MapChange& change) {
    closed_loop_count_ += change.closed_loop ? 1 : 0;
    EXPECT_EQ(change.T_map_odom, back_end_.T_map_odom());
    if (!change.closed_loop) {
      EXPECT_EQ(change.T_map_odom, last_T_map_odom_.value_or(change.T_map_odom));
    }
    last_T_map_odom_ = change.T_map_odom;
    for (const LineId id : change.removed) EXPECT_EQ(copy_.erase(id), 1U);
    for (const LineId id : change.upserted) copy_[id] = back_end_.map().at(id);
    ASSERT_EQ(copy_.size(), back_end_.map().size());
    for (const auto& [id, line] : back_end_.map()) {
      ASSERT_EQ(copy_.at(id).revision, line.revision);
      ASSERT_EQ(copy_.at(id).vertices, line.vertices);
    }
  }
  NoProbe probe_;
  BackEnd back_end_;
  VectorMap copy_;
  std::optional<Pose2> last_T_map_odom_;
  int closed_loop_count_ = 0;
};

Errors odometry_errors(const std::vector<Keyframe>& keyframes, const std::vector<Pose2>& truth) {
  std::vector<TrajectoryPoint> odometry;
  for (const Keyframe& keyframe : keyframes) odometry.push_back({keyframe.time, keyframe.T_odom_vehicle});
  return errors(odometry, truth);
}

void expect_two_kerbs(const BackEnd& back_end, const World& world) {
  for (const auto& [id, line] : back_end.map()) {
    for (const Vertex& v : line.vertices) EXPECT_LT(distance_to_world_m(v.position(), world), 0.5) << "line " << id;
  }
  EXPECT_NEAR(back_end.report().map_length_m, length_m(world), 0.05 * length_m(world));
  EXPECT_LE(back_end.map().size(), 4U);
}

TEST(BackEnd, a_drifting_lap_closes_and_leaves_two_kerbs_not_four) {
  const World world = worlds::block_street();
  const std::vector<Pose2> truth = lap_and_more();
  for (unsigned seed = 0; seed < 3; ++seed) {
    const std::vector<Keyframe> keyframes = worlds::keyframes_of(world, truth, {.noise_m = 0.03}, Drift{}, seed);
    const Errors before = odometry_errors(keyframes, truth);
    const Mapping run(keyframes);
    const Errors after = errors(run.back_end().trajectory(), truth);
    EXPECT_GT(before.greatest_m, 2.0);
    EXPECT_LT(after.mean_m, 0.25 * before.mean_m) << "seed " << seed;
    EXPECT_LT(after.greatest_m, 0.6) << "seed " << seed;
    EXPECT_GE(run.closed_loop_count(), 1);
    EXPECT_GE(run.back_end().report().rederive_count, 1U);
    EXPECT_EQ(run.back_end().report().loops_switched_off_count, 0U);
    expect_two_kerbs(run.back_end(), world);
  }
}

TEST(BackEnd, a_place_is_recognised_in_the_other_driving_direction) {
  const World world = worlds::block_street();
  const std::vector<Pose2> truth = lap_and_back();
  const std::vector<Keyframe> keyframes = worlds::keyframes_of(world, truth, {.noise_m = 0.03}, Drift{}, 3);
  const Errors before = odometry_errors(keyframes, truth);
  const Mapping run(keyframes);
  const Errors after = errors(run.back_end().trajectory(), truth);
  EXPECT_GE(run.back_end().report().loops.accepted_count, 3U);
  EXPECT_LT(after.greatest_m, before.greatest_m);
  EXPECT_NEAR(run.back_end().report().map_length_m, length_m(world), 0.15 * length_m(world));
}

TEST(BackEnd, a_parallel_street_is_no_loop) {
  // Out on one street, back on another 14 m beside it that looks the same; neither is seen from the other.
  const World first = worlds::straight_street(-60, 60), second = [] {
    World world = worlds::straight_street(-60, 60);
    for (Points& line : world) {
      for (Eigen::Vector2d& p : line) p.y() += 14;
    }
    return world;
  }();
  for (unsigned seed = 0; seed < 5; ++seed) {
    const std::vector<Pose2> out = worlds::drive_along({{-30, -1.5}, {30, -1.5}});
    std::vector<Pose2> back = worlds::drive_along({{30, 15.5}, {-30, 15.5}});
    std::vector<Pose2> truth = out;
    truth.insert(truth.end(), back.begin(), back.end());
    std::vector<Keyframe> keyframes = worlds::keyframes_of(first, truth, {.noise_m = 0.03}, Drift{}, seed);
    std::mt19937_64 random(seed);
    for (std::size_t k = out.size(); k < truth.size(); ++k) {
      keyframes[k].lvm = worlds::seen_from(second, truth[k], {.noise_m = 0.03}, random);
    }
    const Mapping run(keyframes);
    EXPECT_EQ(run.back_end().report().loops.accepted_count, 0U) << "seed " << seed;
    EXPECT_EQ(run.closed_loop_count(), 0);
    EXPECT_EQ(run.back_end().map().size(), 4U) << "seed " << seed;
  }
}

TEST(BackEnd, the_same_keyframes_give_the_same_bytes) {
  const std::vector<Keyframe> keyframes =
      worlds::keyframes_of(worlds::block_street(), lap_and_more(), {.noise_m = 0.03}, Drift{}, 4);
  const Mapping once(keyframes), again(keyframes);
  ASSERT_EQ(once.back_end().map().size(), again.back_end().map().size());
  for (const auto& [id, line] : once.back_end().map()) {
    const MapLine& other = again.back_end().map().at(id);
    EXPECT_EQ(line.vertices, other.vertices);
    EXPECT_EQ(line.attributes, other.attributes);
    EXPECT_EQ(line.revision, other.revision);
  }
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    EXPECT_EQ(once.back_end().trajectory()[k].T_map_vehicle, again.back_end().trajectory()[k].T_map_vehicle);
  }
}

TEST(BackEnd, the_map_begins_at_the_anchor) {
  const World world = worlds::straight_street(-60, 60);
  const Pose2 anchor{100, 200, kPi / 3};
  const std::vector<Pose2> truth = worlds::drive_along({{0, -1.5}, {40, -1.5}});
  const std::vector<Keyframe> keyframes = worlds::keyframes_of(world, truth, {}, {.scale = 0, .bias_radpm = 0}, 1);
  const Mapping run(keyframes, anchor);
  EXPECT_EQ(run.back_end().T_map_odom(), anchor);
  EXPECT_EQ(run.back_end().trajectory().front().T_map_vehicle, anchor * truth.front());
  ASSERT_EQ(run.back_end().map().size(), 2U);
  for (const auto& [id, line] : run.back_end().map()) {
    for (const Vertex& v : line.vertices) {
      EXPECT_LT(distance_to_world_m(anchor.inverse() * v.position(), world), 0.3);
    }
  }
}

TEST(BackEnd, without_keyframes_there_is_an_empty_map) {
  const Mapping run({});
  EXPECT_TRUE(run.back_end().map().empty());
  EXPECT_TRUE(run.back_end().trajectory().empty());
}

}  // namespace
}  // namespace roadvec
