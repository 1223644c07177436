#include "daemon/server/map_server.h"

#include <gtest/gtest.h>

#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

using MapServerTest = MapSocket;

TEST_F(MapServerTest, a_client_from_the_beginning_and_one_that_joins_late_have_the_servers_map) {
  start();
  MapClient early = connect();
  ASSERT_TRUE(early.send(wire::Subscribe{}));
  wire::MapReplica from_start, from_snapshot;
  follow(early, from_start, 0);
  publish(100);
  MapClient late = connect();
  ASSERT_TRUE(late.send(wire::Subscribe{}));
  publish(60);
  follow(early, from_start, head_seq());
  follow(late, from_snapshot, head_seq());
  EXPECT_EQ(difference_between(from_start.lines(), story_.map()), std::nullopt);
  EXPECT_EQ(difference_between(from_snapshot.lines(), story_.map()), std::nullopt);
  EXPECT_EQ(from_start.epoch(), kStart.epoch + 2) << "two loops were closed and announced";
}

TEST_F(MapServerTest, welcome_tells_versions_epoch_anchor_and_head) {
  start();
  publish(10);
  MapClient watcher = connect();
  wire::MapReplica replica;
  ASSERT_TRUE(watcher.send(wire::Subscribe{}));
  follow(watcher, replica, 10);
  const MapClient client = connect();
  const wire::Welcome& welcome = client.welcome();
  EXPECT_EQ(welcome.proto_major, wire::kProtoMajor);
  EXPECT_EQ(welcome.epoch, kStart.epoch);
  EXPECT_EQ(welcome.head_seq, 10U);
  EXPECT_EQ(welcome.oldest_seq, 1U);
  EXPECT_EQ(welcome.anchor, config_.facts.anchor);
  EXPECT_EQ(welcome.server_version, "0.0-test");
}

TEST_F(MapServerTest, everything_published_before_the_stop_is_sent_before_bye) {
  start();
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Subscribe{}));
  wire::MapReplica replica;
  follow(client, replica, 0);
  publish(300);
  thread_.request_stop();
  while (true) {
    const auto message = client.receive(kPatience);
    ASSERT_TRUE(message) << message.error().message;
    ASSERT_NE(replica.apply(*message), wire::MapReplica::Outcome::out_of_order);
    if (const auto* bye = std::get_if<wire::Bye>(&*message)) {
      EXPECT_EQ(bye->reason, wire::Bye::Reason::shutdown);
      break;
    }
  }
  EXPECT_EQ(difference_between(replica.lines(), story_.map()), std::nullopt);
  stop();
  EXPECT_TRUE(served_to_the_end_);
  EXPECT_FALSE(std::filesystem::exists(config_.socket_path));
}

TEST_F(MapServerTest, a_subscriber_resumes_where_it_was) {
  start();
  publish(20);
  wire::MapReplica replica;
  {
    MapClient client = connect();
    ASSERT_TRUE(client.send(wire::Subscribe{}));
    follow(client, replica, 20);
  }
  publish(20);
  MapClient again = connect();
  wire::Subscribe subscribe;
  subscribe.resume = wire::Resume{replica.epoch(), replica.seq()};
  ASSERT_TRUE(again.send(subscribe));
  const auto resumed = again.receive_one<wire::Resumed>(kPatience);
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->from_seq, 21U);
  follow(again, replica, head_seq());
  EXPECT_EQ(difference_between(replica.lines(), story_.map()), std::nullopt);
}

TEST_F(MapServerTest, one_that_slept_past_the_log_is_told_and_gets_only_the_tiles_that_changed) {
  start(8 << 10);
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Subscribe{}));
  wire::MapReplica replica;
  publish(124);
  follow(client, replica, head_seq());
  std::vector<wire::MapReplica> asleep;
  for (int i = 0; i < 54; ++i) {  // more than the log holds, without a loop closure that would touch every tile
    asleep.push_back(replica);
    publish(1);
    follow(client, replica, head_seq());
  }
  asleep.resize(40);
  const std::uint64_t last_asleep_seq = asleep.back().seq();
  for (wire::MapReplica& copy : asleep) {
    wire::Subscribe subscribe;
    subscribe.resume = copy.resume();
    ASSERT_TRUE(client.send(subscribe));
    const auto overrun = client.receive_one<wire::Overrun>(kPatience);
    ASSERT_TRUE(overrun) << overrun.error().message;
    EXPECT_EQ(overrun->first_lost_seq, copy.seq() + 1);
    EXPECT_EQ(overrun->last_lost_seq, head_seq());
    EXPECT_EQ(overrun->T_map_odom, replica.T_map_odom());
    EXPECT_LT(overrun->tile_count, replica.tiles().size());
    ASSERT_EQ(copy.apply(*overrun), wire::MapReplica::Outcome::applied);
    follow(client, copy, head_seq());
    EXPECT_EQ(copy.tiles(), replica.tiles());
  }
  EXPECT_EQ(difference_between(replica.lines(), story_.map()), std::nullopt);
  EXPECT_GE(server_->counters().overruns_count.load(), asleep.size());
  EXPECT_GT(connect().welcome().oldest_seq, last_asleep_seq + 1) << "what the log has overwritten is not held";
}

TEST_F(MapServerTest, an_unknown_epoch_cannot_be_resumed_and_gets_a_snapshot) {
  start();
  publish(5);
  MapClient client = connect();
  wire::Subscribe subscribe;
  subscribe.resume = wire::Resume{kStart.epoch + 99, 3};
  ASSERT_TRUE(client.send(subscribe));
  EXPECT_TRUE(client.receive_one<wire::SnapshotBegin>(kPatience));
}

TEST_F(MapServerTest, a_known_tile_is_left_out_of_a_snapshot) {
  start();
  publish(60);
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Subscribe{}));
  wire::MapReplica replica;
  follow(client, replica, head_seq());
  wire::Subscribe subscribe;
  subscribe.known_epoch = replica.epoch();
  for (const auto& [key, tile] : replica.tiles()) subscribe.known.push_back({key, tile.revision});
  subscribe.known.front().revision += 1;
  ASSERT_TRUE(client.send(subscribe));
  const auto begin = client.receive_one<wire::SnapshotBegin>(kPatience);
  ASSERT_TRUE(begin);
  EXPECT_TRUE(begin->incremental);
  EXPECT_EQ(begin->tile_count, 1U);
}

TEST_F(MapServerTest, a_subscriber_to_an_area_gets_its_tiles_alone_and_no_gap) {
  start();
  MapClient client = connect();
  wire::Subscribe subscribe;
  subscribe.area = wire::Area{0, -1'000'000, 127'000, 1'000'000};
  ASSERT_TRUE(client.send(subscribe));
  wire::MapReplica replica;
  publish(100);
  follow(client, replica, head_seq());
  ASSERT_FALSE(replica.tiles().empty());
  for (const auto& [key, tile] : replica.tiles()) EXPECT_TRUE(key.ix == 0 || key.ix == 1);
}

TEST_F(MapServerTest, tiles_are_given_by_area_by_name_and_around_the_vehicle) {
  start();
  publish(60);
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Subscribe{}));
  wire::MapReplica replica;
  follow(client, replica, head_seq());

  ASSERT_TRUE(client.send(wire::GetTiles{}));
  const auto all = client.receive_one<wire::Tiles>(kPatience);
  ASSERT_TRUE(all) << all.error().message;
  EXPECT_EQ(all->as_of_seq, head_seq());
  ASSERT_EQ(all->tiles.size(), replica.tiles().size());
  for (const Tile& tile : all->tiles) EXPECT_EQ(tile, replica.tiles().at(tile.key));

  wire::GetTiles named;
  named.keys = {all->tiles[1].key, {1000, 1000}};
  ASSERT_TRUE(client.send(named));
  EXPECT_EQ(client.receive_one<wire::Tiles>(kPatience)->tiles.size(), 1U);

  wire::GetTiles around;
  around.around_vehicle_m = 10;
  ASSERT_TRUE(client.send(around));
  EXPECT_FALSE(client.receive_one<wire::Tiles>(kPatience)) << "no pose yet";
  poses_.store({.time = {1}, .T_odom_vehicle = {90, 0, 0}});
  wire::Subscribe with_poses;
  with_poses.poses = true;
  ASSERT_TRUE(client.send(with_poses));
  ASSERT_TRUE(client.send(around));
  // The server looks for a pose at its next tick at the latest.
  Expected<wire::Tiles> near = client.receive_one<wire::Tiles>(kPatience);
  while (!near) {
    ASSERT_TRUE(client.send(around));
    near = client.receive_one<wire::Tiles>(kPatience);
  }
  for (const Tile& tile : near->tiles) EXPECT_EQ(tile.key.ix, 1);
}

TEST_F(MapServerTest, poses_reach_those_who_asked_and_no_others) {
  start();
  MapClient asked = connect(), other = connect();
  wire::Subscribe subscribe;
  subscribe.poses = true;
  ASSERT_TRUE(asked.send(subscribe));
  ASSERT_TRUE(other.send(wire::Subscribe{}));
  std::jthread mapping([&](std::stop_token token) {
    for (std::int64_t i = 1; !token.stop_requested(); ++i) {
      poses_.store({.time = {i}, .T_odom_vehicle = {3, 4, 0.5}, .speed_mps = 8});
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  std::int64_t last_ns = 0;
  for (int i = 0; i < 10; ++i) {
    const auto pose = asked.receive_one<wire::Pose>(kPatience);
    ASSERT_TRUE(pose) << pose.error().message;
    EXPECT_GT(pose->time.ns, last_ns);
    last_ns = pose->time.ns;
    EXPECT_EQ(pose->T_odom_vehicle, (Pose2{3, 4, 0.5}));
    EXPECT_EQ(pose->T_map_vehicle, pose->T_map_odom * pose->T_odom_vehicle);
    EXPECT_EQ(pose->speed_mps, 8);
  }
  ASSERT_TRUE(other.send(wire::Ping{1}));
  while (true) {
    const auto message = other.receive(kPatience);
    ASSERT_TRUE(message);
    EXPECT_FALSE(std::holds_alternative<wire::Pose>(*message));
    if (std::holds_alternative<wire::Pong>(*message)) break;
  }
}

TEST_F(MapServerTest, changes_and_poses_keep_to_the_rate_a_client_asked_for) {
  start();
  MapClient client = connect();
  wire::Subscribe subscribe;
  subscribe.max_rate_hz = 5;
  ASSERT_TRUE(client.send(subscribe));
  wire::MapReplica replica;
  follow(client, replica, 0);
  const auto begin = std::chrono::steady_clock::now();
  for (int burst = 0; burst < 3; ++burst) {
    publish(1);
    follow(client, replica, head_seq());
  }
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(380));
}

TEST_F(MapServerTest, status_has_the_daemons_state_and_the_servers_own_counters) {
  start();
  publish(3);
  MapClient client = connect();
  wire::Status status;
  // Made once a second: the first one may be from before we came.
  for (int i = 0; i < 100 && (status.stages.empty() || status.stages.back().counters[0].value < 1); ++i) {
    ASSERT_TRUE(client.send(wire::GetStatus{}));
    const auto answer = client.receive_one<wire::Status>(kPatience);
    ASSERT_TRUE(answer) << answer.error().message;
    status = *answer;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(status.state, "mapping");
  EXPECT_EQ(status.head_seq, 3U);
  EXPECT_EQ(status.server_version, "0.0-test");
  ASSERT_FALSE(status.stages.empty());
  EXPECT_EQ(status.stages.back().name, "server");
  EXPECT_EQ(status.stages.back().counters[0].name, "clients_connected");
  EXPECT_EQ(status.stages.back().counters[0].value, 1U);
}

TEST_F(MapServerTest, heartbeats_come_without_asking) {
  start();
  MapClient client = connect();
  EXPECT_TRUE(client.receive_one<wire::Heartbeat>(kPatience));
}

TEST_F(MapServerTest, a_request_of_a_later_minor_is_answered_as_unsupported_and_the_connection_stays) {
  start();
  MapClient client = connect();
  ASSERT_TRUE(client.send_bytes(std::string("\x03\x00\x00\x00\xFA\x3F\x00", 7)));  // field 1023, empty
  ASSERT_TRUE(client.send(wire::Ping{5}));
  EXPECT_FALSE(client.receive_one<wire::Pong>(kPatience)) << "first the Error for the unknown request";
  EXPECT_EQ(client.receive_one<wire::Pong>(kPatience)->nonce, 5U);
}

}  // namespace
}  // namespace roadvec
