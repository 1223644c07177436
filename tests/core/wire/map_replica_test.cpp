#include "core/wire/map_replica.h"

#include <gtest/gtest.h>

#include "core/wire/codec.h"
#include "tests/support/map_story.h"

namespace roadvec::wire {
namespace {

using Outcome = MapReplica::Outcome;

Delta delta_of(TileTable& table, const MapChange& change, const VectorMap& map, std::uint64_t seq) {
  Delta delta;
  delta.epoch = 5;
  delta.seq = seq;
  delta.time = change.time;
  delta.T_map_odom = change.T_map_odom;
  delta.tiles = table.apply(change, map);
  return delta;
}

TEST(MapReplica, deltas_over_the_wire_give_the_published_map_after_every_change) {
  std::vector<char> buffer(1 << 20);
  for (unsigned seed = 0; seed < 5; ++seed) {
    MapStory story(seed);
    TileTable table;
    MapReplica replica = MapReplica::empty_at(5, 0);
    for (std::uint64_t seq = 1; seq <= 200; ++seq) {
      const MapChange change = story.step();
      const std::string_view frame = encode_frame(delta_of(table, change, story.map(), seq), buffer);
      const auto message = decode_envelope(frame.substr(kFrameHeaderBytes), Sender::server);
      ASSERT_TRUE(message) << message.error().message;
      ASSERT_EQ(replica.apply(*message), Outcome::applied);
      if (seq % 10 == 0) {
        ASSERT_EQ(difference_between(replica.lines(), story.map()), std::nullopt) << "seed " << seed << " seq " << seq;
      }
    }
  }
}

TEST(MapReplica, a_missing_delta_and_one_of_another_epoch_are_refused) {
  MapReplica replica = MapReplica::empty_at(5, 0);
  Delta delta;
  delta.epoch = 5;
  delta.seq = 2;
  EXPECT_EQ(replica.apply(delta), Outcome::out_of_order);
  delta.seq = 1;
  EXPECT_EQ(replica.apply(delta), Outcome::applied);
  delta.seq = 2;
  delta.epoch = 6;
  EXPECT_EQ(replica.apply(delta), Outcome::out_of_order);
  EXPECT_EQ(replica.apply(EpochChange{EpochChange::Reason::loop_closure, 5, 6, 2, {}, {}, {}}), Outcome::applied);
  delta.seq = 3;
  EXPECT_EQ(replica.apply(delta), Outcome::applied);
  EXPECT_EQ(replica.epoch(), 6U);
}

TEST(MapReplica, a_snapshot_forgets_what_was_there_unless_it_is_incremental) {
  MapReplica replica;
  EXPECT_EQ(replica.apply(Tile{{1, 2}, 1, {}}), Outcome::out_of_order);
  EXPECT_EQ(replica.apply(SnapshotBegin{5, 9, {}, 1, false}), Outcome::applied);
  EXPECT_FALSE(replica.consistent());
  EXPECT_EQ(replica.apply(Tile{{1, 2}, 1, {}}), Outcome::applied);
  EXPECT_EQ(replica.apply(SnapshotEnd{5, 9, {}}), Outcome::applied);
  EXPECT_TRUE(replica.consistent());
  EXPECT_EQ(replica.apply(SnapshotBegin{5, 10, {}, 0, true}), Outcome::applied);
  EXPECT_EQ(replica.apply(SnapshotEnd{5, 10, {}}), Outcome::applied);
  EXPECT_EQ(replica.tiles().size(), 1U);
  EXPECT_EQ(replica.apply(SnapshotBegin{5, 10, {}, 0, false}), Outcome::applied);
  EXPECT_TRUE(replica.tiles().empty());
}

TEST(MapReplica, a_snapshot_that_broke_off_is_no_map_to_resume_from) {
  MapReplica replica;
  EXPECT_FALSE(replica.resume());
  (void)replica.apply(SnapshotBegin{5, 9, {}, 2, false});
  (void)replica.apply(Tile{{1, 2}, 3, {}});
  EXPECT_FALSE(replica.resume());
  EXPECT_EQ(replica.apply(Resumed{10}), Outcome::out_of_order);
  ASSERT_EQ(replica.known().size(), 1U);
  EXPECT_EQ(replica.known()[0].revision, 3U);
  (void)replica.apply(SnapshotEnd{5, 9, {}});
  ASSERT_TRUE(replica.resume());
  EXPECT_EQ(replica.resume()->seq, 9U);
  EXPECT_EQ(replica.apply(Resumed{10}), Outcome::applied);
  (void)replica.apply(Overrun{5, 10, 12, 1, std::nullopt});
  EXPECT_FALSE(replica.resume());
}

TEST(MapReplica, an_overrun_past_a_closed_loop_moves_the_correction_before_the_tiles) {
  MapReplica replica = MapReplica::empty_at(5, 3);
  EXPECT_EQ(replica.apply(Overrun{6, 4, 9, 1, Pose2{1, 2, 0.5}}), Outcome::applied);
  EXPECT_EQ(replica.T_map_odom(), (Pose2{1, 2, 0.5}));
  EXPECT_EQ(replica.epoch(), 6U);
  EXPECT_FALSE(replica.consistent());
}

TEST(MapReplica, a_change_in_several_frames_is_consistent_only_after_the_last) {
  MapReplica replica = MapReplica::empty_at(5, 0);
  Delta delta;
  delta.epoch = 5;
  delta.seq = 1;
  delta.continued = true;
  EXPECT_EQ(replica.apply(delta), Outcome::applied);
  EXPECT_FALSE(replica.consistent());
  delta.seq = 2;
  delta.continued = false;
  EXPECT_EQ(replica.apply(delta), Outcome::applied);
  EXPECT_TRUE(replica.consistent());
}

TEST(MapReplica, lines_of_which_a_piece_is_missing_are_left_out) {
  MapStory story(1);
  TileTable table;
  MapReplica replica = MapReplica::empty_at(5, 0);
  for (std::uint64_t seq = 1; seq <= 60; ++seq) {
    const MapChange change = story.step();
    Delta delta = delta_of(table, change, story.map(), seq);
    std::erase_if(delta.tiles, [](const TileDelta& tile) { return tile.key.ix > 0; });
    ASSERT_EQ(replica.apply(delta), Outcome::applied);
  }
  EXPECT_FALSE(replica.tiles().empty());
  EXPECT_LT(replica.lines().size(), story.map().size());
}

TEST(Area, touches_the_tiles_it_reaches_into_and_no_others) {
  const Area area{0, 0, 64'000, 10};
  EXPECT_TRUE(area.touches({0, 0}));
  EXPECT_TRUE(area.touches({1, 0}));
  EXPECT_FALSE(area.touches({2, 0}));
  EXPECT_FALSE(area.touches({-1, 0}));
  EXPECT_FALSE(area.touches({0, 1}));
}

}  // namespace
}  // namespace roadvec::wire
