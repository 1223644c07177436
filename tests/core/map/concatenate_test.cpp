#include "core/map/concatenate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/geometry/segment.h"
#include "tests/support/worlds.h"

namespace roadvec {
namespace {

using worlds::View;
using worlds::World;

/// A client that only ever sees the changes.
class Client {
 public:
  void apply(const MapChange& change, const VectorMap& map) {
    for (const LineId id : change.removed)
      EXPECT_EQ(lines_.erase(id), 1U) << "removed a line that was never told: " << id;
    for (const LineId id : change.upserted) {
      const MapLine& line = map.at(id);
      if (const auto known = lines_.find(id); known != lines_.end()) {
        EXPECT_GT(line.revision, known->second.revision);
      }
      lines_[id] = line;
    }
    for (const Lineage& lineage : change.lineage) {
      EXPECT_TRUE(std::ranges::find(change.removed, lineage.retired) != change.removed.end());
      for (const LineId heir : lineage.successors) EXPECT_TRUE(map.contains(heir));
    }
    EXPECT_TRUE(std::ranges::is_sorted(change.upserted));
    EXPECT_TRUE(std::ranges::is_sorted(change.removed));
  }
  void expect_equals(const VectorMap& map) const {
    ASSERT_EQ(lines_.size(), map.size());
    for (const auto& [id, line] : map) {
      ASSERT_TRUE(lines_.contains(id));
      EXPECT_EQ(lines_.at(id).revision, line.revision);
      EXPECT_EQ(lines_.at(id).vertices, line.vertices);
      EXPECT_EQ(lines_.at(id).attributes, line.attributes);
    }
  }

 private:
  VectorMap lines_;
};

SensorTime at_s(double s) { return {static_cast<std::int64_t>(s * 1e9)}; }

double length_m(const MapLine& line) {
  double sum_m = 0;
  for (std::size_t i = 1; i < line.vertices.size(); ++i) {
    sum_m += (line.vertices[i].position() - line.vertices[i - 1].position()).norm();
  }
  return sum_m;
}

double distance_to_world_m(const Eigen::Vector2d& p, const World& world) {
  double best = 1e9;
  for (const worlds::Points& line : world) {
    for (std::size_t i = 1; i < line.size(); ++i) best = std::min(best, Segment{line[i - 1], line[i]}.distance2_m2(p));
  }
  return std::sqrt(best);
}

/// Drives through a world with known poses and gives every view to the concatenator.
VectorMap mapped(const World& world, const std::vector<Pose2>& poses, const View& view, unsigned seed,
                 Client* client = nullptr) {
  Concatenator concatenator{ConcatenateConfig{}};
  std::mt19937_64 random(seed);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    concatenator.add(k, at_s(static_cast<double>(k)), worlds::seen_from(world, poses[k], view, random), poses[k]);
    MapChange change;
    concatenator.publish(false, change);
    if (client != nullptr) client->apply(change, concatenator.map());
  }
  MapChange change;
  concatenator.publish(true, change);
  if (client != nullptr) client->apply(change, concatenator.map());
  if (client != nullptr) client->expect_equals(concatenator.map());
  return concatenator.map();
}

std::vector<Pose2> straight_drive(double from_m, double to_m, double step_m, double y_m = -1.5) {
  std::vector<Pose2> poses;
  for (double x = from_m; x <= to_m; x += step_m) poses.push_back({x, y_m, 0});
  return poses;
}

TEST(Concatenator, a_street_with_two_kerbs_seen_thirty_times_is_two_lines_better_than_one_look) {
  const World street = worlds::straight_street(0, 120);
  const double noise_m = 0.05;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Client client;
    const VectorMap map = mapped(street, straight_drive(0, 116, 4), {.noise_m = noise_m}, seed, &client);
    ASSERT_EQ(map.size(), 2U) << "seed " << seed;
    double squares = 0, count = 0;
    for (const auto& [id, line] : map) {
      EXPECT_NEAR(length_m(line), 120, 1.5) << "seed " << seed;
      EXPECT_EQ(line.attributes.kind, BoundaryKind::curb);
      EXPECT_NEAR(line.attributes.height_m, 0.12, 1e-3);
      EXPECT_LE(line.vertices.size(), 40U);
      for (const Vertex& v : line.vertices) {
        squares += std::pow(distance_to_world_m(v.position(), street), 2);
        ++count;
      }
    }
    EXPECT_LT(std::sqrt(squares / count), 0.8 * noise_m) << "seed " << seed;
  }
}

TEST(Concatenator, the_same_lines_again_change_nothing_but_counts) {
  const World world = worlds::crossing();
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937_64 random(seed);
    Concatenator concatenator{ConcatenateConfig{}};
    const LineSet lvm = worlds::seen_from(world, {1, -1, 0.3}, {.noise_m = 0.03}, random);
    MapChange change;
    concatenator.add(0, at_s(0), lvm, {1, -1, 0.3});
    concatenator.add(1, at_s(1), lvm, {1, -1, 0.3});
    concatenator.publish(true, change);
    const VectorMap once = concatenator.map();
    ASSERT_GE(once.size(), 4U);
    for (std::uint64_t k = 2; k < 6; ++k) concatenator.add(k, at_s(static_cast<double>(k)), lvm, {1, -1, 0.3});
    concatenator.publish(true, change);
    ASSERT_EQ(concatenator.map().size(), once.size()) << "seed " << seed;
    for (const auto& [id, line] : once) {
      const MapLine& again = concatenator.map().at(id);
      ASSERT_EQ(again.vertices.size(), line.vertices.size()) << "seed " << seed;
      for (std::size_t i = 0; i < line.vertices.size(); ++i) {
        EXPECT_EQ(again.vertices[i].position(), line.vertices[i].position()) << "seed " << seed;
      }
      EXPECT_GT(again.attributes.observation_count, line.attributes.observation_count);
      EXPECT_LE(again.vertices.front().sigma_across_m, line.vertices.front().sigma_across_m);
    }
  }
}

TEST(Concatenator, the_order_of_observations_changes_the_map_by_less_than_their_noise) {
  const World street = worlds::straight_street(0, 80);
  std::vector<Pose2> poses = straight_drive(0, 80, 4);
  const VectorMap forwards = mapped(street, poses, {.noise_m = 0.02}, 1);
  std::ranges::reverse(poses);
  const VectorMap backwards = mapped(street, poses, {.noise_m = 0.02}, 2);
  ASSERT_EQ(forwards.size(), 2U);
  ASSERT_EQ(backwards.size(), 2U);
  for (const auto& [id, line] : backwards) {
    for (const Vertex& v : line.vertices) EXPECT_LT(distance_to_world_m(v.position(), street), 0.06);
  }
}

TEST(Concatenator, the_mouths_of_a_crossing_stay_open) {
  const World world = worlds::crossing();
  for (unsigned seed = 0; seed < 20; ++seed) {
    Client client;
    const VectorMap map = mapped(world, straight_drive(-38, 38, 2), {.noise_m = 0.03}, seed, &client);
    ASSERT_EQ(map.size(), 4U) << "seed " << seed;
    for (const auto& [id, line] : map) {
      for (std::size_t i = 1; i < line.vertices.size(); ++i) {
        const Eigen::Vector2d middle = 0.5 * (line.vertices[i - 1].position() + line.vertices[i].position());
        EXPECT_LT(distance_to_world_m(middle, world), 0.15) << "seed " << seed;
      }
    }
  }
}

TEST(Concatenator, two_kerbs_of_a_narrow_lane_and_two_faces_of_an_island_stay_two) {
  const World lane = worlds::straight_street(0, 60, 1.5);
  EXPECT_EQ(mapped(lane, straight_drive(0, 60, 3, 0), {.noise_m = 0.03}, 1).size(), 2U);
  // A refuge 1 m wide between two lanes: faces run opposite ways, each has its lane on the right.
  const World island{{{0, 4}, {40, 4}}, {{40, 5}, {0, 5}}};
  EXPECT_EQ(mapped(island, straight_drive(0, 40, 3, 0), {.noise_m = 0.03}, 1).size(), 2U);
  // A kerb with a wall 1 m behind it: same direction, apart all the same.
  const World wall{{{0, 4}, {40, 4}}, {{0, 5}, {40, 5}}};
  EXPECT_EQ(mapped(wall, straight_drive(0, 40, 3, 0), {.noise_m = 0.03}, 1).size(), 2U);
}

TEST(Concatenator, an_observation_that_bridges_two_lines_makes_them_one_and_says_so) {
  Concatenator concatenator{ConcatenateConfig{}};
  Client client;
  std::mt19937_64 random(1);
  const auto add = [&](std::uint64_t k, const World& world) {
    concatenator.add(k, at_s(static_cast<double>(k)), worlds::seen_from(world, {}, {.range_m = 100}, random), {});
    MapChange change;
    concatenator.publish(false, change);
    client.apply(change, concatenator.map());
    return change;
  };
  const World parts{{{0, 4}, {10, 4}}, {{14, 4}, {24, 4}}};
  add(0, parts);
  add(1, parts);
  ASSERT_EQ(concatenator.map().size(), 2U);
  const LineId older = concatenator.map().begin()->first, younger = concatenator.map().rbegin()->first;
  const MapChange change = add(2, {{{6, 4}, {18, 4}}});
  ASSERT_EQ(concatenator.map().size(), 1U);
  const MapLine& line = concatenator.map().begin()->second;
  EXPECT_EQ(line.id, older);
  EXPECT_NEAR(length_m(line), 24, 1e-3);
  EXPECT_EQ(change.removed, std::vector<LineId>{younger});
  ASSERT_EQ(change.lineage.size(), 1U);
  EXPECT_EQ(change.lineage[0].retired, younger);
  EXPECT_EQ(change.lineage[0].successors, std::vector<LineId>{older});
  client.expect_equals(concatenator.map());
}

TEST(Concatenator, nothing_is_drawn_across_what_was_not_seen) {
  // A kerb, and a wall that begins beside its end, leads back behind it and passes it 10 m away.
  const World world{{{0, 4}, {20, 4}}, {{20, 5}, {8, 12}, {30, 14}}};
  const World corner{{{12, 4}, {20, 4}, {20, 5}, {16, 22.0 / 3}}};
  Concatenator concatenator{ConcatenateConfig{}};
  std::mt19937_64 random(1);
  MapChange change;
  for (std::uint64_t k = 0; k < 6; ++k) {
    const LineSet seen = worlds::seen_from(k % 2 == 0 ? world : corner, {}, {.range_m = 100}, random);
    concatenator.add(k, at_s(static_cast<double>(k)), seen, {});
  }
  concatenator.publish(true, change);
  ASSERT_EQ(concatenator.map().size(), 1U);
  for (const auto& [id, line] : concatenator.map()) {
    EXPECT_NEAR(length_m(line), 57.0, 1.0);
    for (std::size_t i = 1; i < line.vertices.size(); ++i) {
      const Eigen::Vector2d a = line.vertices[i - 1].position(), b = line.vertices[i].position();
      for (double u = 0; u <= 1; u += 0.05) EXPECT_LT(distance_to_world_m(a + u * (b - a), world), 0.6);
    }
  }
}

TEST(Concatenator, lines_that_come_to_lie_on_each_other_become_one) {
  Concatenator concatenator{ConcatenateConfig{}};
  Client client;
  std::mt19937_64 random(1);
  const World kerb{{{0, 4}, {30, 4}}};
  const LineSet seen = worlds::seen_from(kerb, {}, {.range_m = 100}, random);
  const std::vector<double> offsets_m{0, 0, 0.9, 0.9, 0.6, 0.6, 0.4, 0.3, 0.2, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1};
  std::size_t most = 0;
  for (std::size_t k = 0; k < offsets_m.size(); ++k) {
    concatenator.add(k, at_s(static_cast<double>(k)), seen, {0, offsets_m[k], 0});
    MapChange change;
    concatenator.publish(false, change);
    client.apply(change, concatenator.map());
    most = std::max(most, concatenator.map().size());
  }
  EXPECT_EQ(most, 2U);  // 0.9 m apart is not the same boundary...
  MapChange change;
  for (std::uint64_t k = 20; k < 40; ++k) concatenator.add(k, at_s(30), seen, {0, 0.45, 0});
  concatenator.publish(true, change);
  client.apply(change, concatenator.map());
  client.expect_equals(concatenator.map());
  EXPECT_EQ(concatenator.map().size(), 1U);  // ...until both were seen between
}

TEST(Concatenator, derived_again_from_the_same_poses_the_map_keeps_its_ids_and_bytes) {
  const World world = worlds::crossing();
  const std::vector<Pose2> poses = straight_drive(-30, 30, 3);
  std::mt19937_64 random(9);
  std::vector<LineSet> views;
  for (const Pose2& pose : poses) views.push_back(worlds::seen_from(world, pose, {.noise_m = 0.03}, random));
  Concatenator concatenator{ConcatenateConfig{}};
  MapChange change;
  for (std::size_t k = 0; k < poses.size(); ++k) concatenator.add(k, at_s(static_cast<double>(k)), views[k], poses[k]);
  concatenator.publish(true, change);
  const VectorMap before = concatenator.map();
  for (std::size_t k = 0; k < poses.size(); ++k) concatenator.withdraw(k, views[k], poses[k]);
  EXPECT_TRUE(concatenator.forget().empty());
  for (std::size_t k = 0; k < poses.size(); ++k) concatenator.add(k, at_s(static_cast<double>(k)), views[k], poses[k]);
  change = {};
  concatenator.end_withdrawal();
  concatenator.publish(true, change);
  EXPECT_TRUE(change.empty());
  ASSERT_EQ(concatenator.map().size(), before.size());
  for (const auto& [id, line] : before) EXPECT_EQ(concatenator.map().at(id).vertices, line.vertices);
}

TEST(Concatenator, only_what_a_moved_keyframe_showed_is_derived_again) {
  const World street = worlds::straight_street(0, 240);
  const std::vector<Pose2> poses = straight_drive(0, 240, 2);
  constexpr std::size_t kMoved = 100;  // from 200 m on
  for (unsigned seed = 0; seed < 10; ++seed) {
    std::mt19937_64 random(seed);
    Concatenator concatenator{ConcatenateConfig{}}, afresh{ConcatenateConfig{}};
    Client client;
    MapChange change;
    std::vector<LineSet> views;
    std::vector<Pose2> believed = poses;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      views.push_back(worlds::seen_from(street, poses[k], {.noise_m = 0.02}, random));
      if (k >= kMoved) believed[k].y_m += 0.01 * static_cast<double>(k - kMoved);
      concatenator.add(k, at_s(static_cast<double>(k)), views[k], believed[k]);
      afresh.add(k, at_s(static_cast<double>(k)), views[k], poses[k]);
    }
    concatenator.publish(true, change);
    client.apply(change, concatenator.map());
    ASSERT_EQ(concatenator.map().size(), 2U) << "seed " << seed;
    const VectorMap before = concatenator.map();

    for (std::size_t k = kMoved; k < poses.size(); ++k) concatenator.withdraw(k, views[k], believed[k]);
    std::set<std::uint64_t> again = concatenator.forget();
    EXPECT_GT(*again.begin(), 60U);  // 30 m of view on both sides, and a square
    EXPECT_LT(*again.rbegin(), kMoved);
    for (std::size_t k = kMoved; k < poses.size(); ++k) again.insert(k);
    for (const std::uint64_t k : again) concatenator.add(k, at_s(static_cast<double>(k)), views[k], poses[k]);
    concatenator.end_withdrawal();
    change = {};
    concatenator.publish(true, change);
    client.apply(change, concatenator.map());
    client.expect_equals(concatenator.map());
    afresh.publish(true, change);
    ASSERT_EQ(concatenator.map().size(), 2U) << "seed " << seed;
    for (const auto& [id, line] : concatenator.map()) {
      ASSERT_TRUE(before.contains(id)) << "seed " << seed;
      EXPECT_NEAR(length_m(line), length_m(afresh.map().at(id)), 1.0) << "seed " << seed;
      for (const Vertex& v : line.vertices) {
        EXPECT_LT(distance_to_world_m(v.position(), street), 0.06) << "seed " << seed;
        const auto known = [&](const Vertex& old) { return old.position() == v.position(); };
        if (v.x_m < 96) {
          EXPECT_TRUE(std::ranges::any_of(before.at(id).vertices, known)) << v.x_m;
        }
      }
    }
  }
}

TEST(Concatenator, what_one_keyframe_saw_or_what_is_too_short_is_not_published) {
  Concatenator concatenator{ConcatenateConfig{}};
  std::mt19937_64 random(1);
  const LineSet seen = worlds::seen_from({{{0, 4}, {20, 4}}, {{0, -4}, {0.6, -4}}}, {}, {}, random);
  MapChange change;
  concatenator.add(0, at_s(0), seen, {});
  concatenator.publish(true, change);
  EXPECT_TRUE(concatenator.map().empty());
  concatenator.add(1, at_s(1), seen, {});
  concatenator.publish(false, change);
  EXPECT_EQ(concatenator.map().size(), 1U);
}

TEST(Concatenator, shifts_below_the_limit_are_not_published_until_the_end) {
  Concatenator concatenator{ConcatenateConfig{}};
  std::mt19937_64 random(1);
  const LineSet seen = worlds::seen_from({{{0, 4}, {20, 4}}}, {}, {}, random);
  MapChange change;
  concatenator.add(0, at_s(0), seen, {});
  concatenator.add(1, at_s(1), seen, {});
  concatenator.publish(false, change);
  ASSERT_EQ(change.upserted.size(), 1U);
  change = {};
  concatenator.add(2, at_s(2), seen, {0, 0.03, 0});
  concatenator.publish(false, change);
  EXPECT_TRUE(change.empty());
  concatenator.publish(true, change);
  ASSERT_EQ(change.upserted.size(), 1U);
  EXPECT_NEAR(concatenator.map().begin()->second.vertices.front().y_m, 4.01, 1e-9);
  EXPECT_EQ(concatenator.map().begin()->second.revision, 2U);
}

TEST(Concatenator, published_vertices_are_whole_millimetres_and_ends_say_why) {
  Concatenator concatenator{ConcatenateConfig{}};
  std::mt19937_64 random(1);
  LineSet seen = worlds::seen_from({{{0, 4}, {20, 4}}}, {}, {.noise_m = 0.04}, random);
  seen.lines()[0].attributes.last_end = EndKind::open;
  MapChange change;
  concatenator.add(0, at_s(0), seen, {0.1234567, 0.7654321, 0.3});
  seen.lines()[0].attributes.last_end = EndKind::unseen;
  concatenator.add(1, at_s(1), seen, {0.1234567, 0.7654321, 0.3});
  concatenator.publish(true, change);
  const MapLine& line = concatenator.map().begin()->second;
  for (const Vertex& v : line.vertices) {
    EXPECT_NEAR(v.x_m * 1000, std::round(v.x_m * 1000), 1e-6);
    EXPECT_NEAR(v.y_m * 1000, std::round(v.y_m * 1000), 1e-6);
  }
  EXPECT_EQ(line.attributes.first_end, EndKind::unseen);
  EXPECT_EQ(line.attributes.last_end, EndKind::open);
  EXPECT_EQ(line.first_seen, at_s(0));
  EXPECT_EQ(line.last_seen, at_s(1));
}

}  // namespace
}  // namespace roadvec
