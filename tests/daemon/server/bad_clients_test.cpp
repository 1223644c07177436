#include <gtest/gtest.h>

#include <random>

#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

using Reason = wire::Bye::Reason;

/// Clients that break the rules of the conversation: each is told why, closed and counted, and the others never notice.
class BadClientsTest : public MapSocket {
 protected:
  [[nodiscard]] MapClient open() {
    Expected<MapClient> client = MapClient::open(config_.socket_path);
    if (!client) throw std::runtime_error(client.error().message);
    return std::move(*client);
  }
  void expect_dismissed(MapClient& client, Reason reason) {
    EXPECT_EQ(farewell(client).reason, reason);
    EXPECT_FALSE(client.receive(kPatience)) << "closed after Bye";
    EXPECT_EQ(closed(reason), 1U);
  }
};

TEST_F(BadClientsTest, silence_instead_of_hello) {
  config_.hello_timeout_s = 0.2;
  start();
  MapClient client = open();
  expect_dismissed(client, Reason::hello_timeout);
}

TEST_F(BadClientsTest, another_major_version) {
  start();
  MapClient client = open();
  ASSERT_TRUE(client.send(wire::Hello{.proto_major = 2, .proto_minor = 0, .client_name = "", .capabilities = 0}));
  expect_dismissed(client, Reason::protocol_version);
}

TEST_F(BadClientsTest, a_request_before_hello) {
  start();
  MapClient client = open();
  ASSERT_TRUE(client.send(wire::GetTiles{}));
  expect_dismissed(client, Reason::unexpected_message);
}

TEST_F(BadClientsTest, hello_twice) {
  start();
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Hello{}));
  expect_dismissed(client, Reason::unexpected_message);
}

TEST_F(BadClientsTest, garbage) {
  start();
  MapClient client = open();
  ASSERT_TRUE(client.send_bytes(std::string("\x04\x00\x00\x00\xFF\xFF\xFF\xFF", 8)));
  expect_dismissed(client, Reason::malformed);
}

TEST_F(BadClientsTest, a_message_that_only_servers_send) {
  start();
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Bye{}));
  expect_dismissed(client, Reason::malformed);
}

TEST_F(BadClientsTest, frames_of_no_bytes_and_of_too_many) {
  start();
  MapClient nothing = open(), too_long = open();
  ASSERT_TRUE(nothing.send_bytes(std::string(4, '\0')));
  EXPECT_EQ(farewell(nothing).reason, Reason::frame_length);
  ASSERT_TRUE(too_long.send_bytes(std::string("\x01\x00\x10\x00", 4)));
  EXPECT_EQ(farewell(too_long).reason, Reason::frame_length);
}

TEST_F(BadClientsTest, half_a_frame_also_when_heartbeats_come_between) {
  for (const double timeout_s : {0.2, 1.2}) {
    config_.half_frame_timeout_s = timeout_s;
    start();
    MapClient client = connect();
    ASSERT_TRUE(client.send_bytes(std::string("\x08\x00\x00\x00\x9A\x01", 6)));
    expect_dismissed(client, Reason::frame_timeout);
    stop();
  }
}

TEST_F(BadClientsTest, a_name_without_end) {
  start();
  MapClient client = open();
  wire::Hello hello;
  hello.client_name = std::string(257, 'x');
  ASSERT_TRUE(client.send(hello));
  expect_dismissed(client, Reason::malformed);
}

TEST_F(BadClientsTest, an_area_with_swapped_corners_is_refused_and_the_connection_stays) {
  start();
  MapClient client = connect();
  wire::Subscribe subscribe;
  subscribe.area = wire::Area{1, 0, 0, 1};
  wire::GetTiles request;
  request.area = subscribe.area;
  ASSERT_TRUE(client.send(subscribe));
  EXPECT_FALSE(client.receive_one<wire::SnapshotBegin>(kPatience));
  ASSERT_TRUE(client.send(request));
  EXPECT_FALSE(client.receive_one<wire::Tiles>(kPatience));
  ASSERT_TRUE(client.send(wire::Ping{1}));
  EXPECT_TRUE(client.receive_one<wire::Pong>(kPatience));
}

TEST_F(BadClientsTest, a_hello_in_single_bytes_is_no_fault) {
  start();
  MapClient client = open();
  std::vector<char> buffer(256);
  wire::Hello hello;
  hello.client_name = "dripping";
  for (const char byte : std::string(wire::encode_frame(hello, buffer))) {
    ASSERT_TRUE(client.send_bytes({&byte, 1}));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(client.receive_one<wire::Welcome>(kPatience));
}

TEST_F(BadClientsTest, one_that_does_not_read_is_closed_and_the_others_never_wait) {
  config_.stall_timeout_s = 0.5;
  config_.farewell_s = 0.3;
  start();
  MapClient stuck = connect(), reader = connect();
  ASSERT_TRUE(stuck.send(wire::Subscribe{}));
  ASSERT_TRUE(reader.send(wire::Subscribe{}));
  wire::MapReplica replica;
  for (int i = 0; i < 200 && closed(Reason::stalled) == 0; ++i) {
    publish(10);
    follow(reader, replica, head_seq());
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(closed(Reason::stalled), 1U);
  EXPECT_EQ(difference_between(replica.lines(), story_.map()), std::nullopt);
}

TEST_F(BadClientsTest, a_flood_of_requests_is_answered_one_by_one) {
  start();
  MapClient flood = connect();
  std::vector<char> buffer(64);
  std::string pings;
  constexpr std::uint64_t kPings = 20'000;
  for (std::uint64_t i = 1; i <= kPings; ++i) pings += wire::encode_frame(wire::Ping{i}, buffer);
  std::jthread sender([&] { EXPECT_TRUE(flood.send_bytes(pings)); });
  for (std::uint64_t i = 1; i <= kPings; ++i) {
    const auto pong = flood.receive_one<wire::Pong>(kPatience);
    ASSERT_TRUE(pong) << pong.error().message;
    ASSERT_EQ(pong->nonce, i);
  }
}

/// 30 clients that ask for the whole map and never read: what waits for each is a batch, not the map.
TEST_F(BadClientsTest, many_that_never_read_cost_neither_memory_nor_the_writers_time) {
  config_.most_clients = config_.most_clients_per_user = 100;
  config_.send_buffer_bytes = 4096;
  config_.facts.batch_bytes = 1024;
  story_ = MapStory(1, 1'000'000);
  start(std::size_t{2} << 20);
  MapClient reader = connect();
  ASSERT_TRUE(reader.send(wire::Subscribe{}));
  wire::MapReplica replica;
  for (int i = 0; i < 12; ++i) {
    publish(50);
    follow(reader, replica, head_seq());
  }
  std::size_t map_bytes = 0;
  std::vector<char> buffer(wire::kMostServerBytes);
  for (const auto& [key, tile] : replica.tiles()) map_bytes += wire::encode_frame(tile, buffer).size();
  std::vector<MapClient> never;
  for (int i = 0; i < 30; ++i) {
    never.push_back(connect());
    if (i % 2 == 0) {
      ASSERT_TRUE(never.back().send(wire::Subscribe{}));
    } else {
      ASSERT_TRUE(never.back().send(wire::GetTiles{}));
    }
    publish(5);
    follow(reader, replica, head_seq());
  }
  double waiting_bytes = 0;
  ASSERT_TRUE(reader.receive_one<wire::Heartbeat>(kPatience));
  ASSERT_TRUE(reader.receive_one<wire::Heartbeat>(kPatience)) << "made with a status that knows them all";
  ASSERT_TRUE(reader.send(wire::GetStatus{}));
  const auto status = reader.receive_one<wire::Status>(kPatience);
  ASSERT_TRUE(status);
  for (const wire::Gauge& gauge : status->stages.back().gauges) {
    if (gauge.name == "waiting_bytes") waiting_bytes = gauge.value;
  }
  std::printf("map %zu bytes, waiting %.0f bytes\n", map_bytes, waiting_bytes);
  EXPECT_GT(map_bytes, std::size_t{20'000});
  EXPECT_GT(waiting_bytes, 0);
  EXPECT_LT(waiting_bytes, 30.0 * 8'000);  // a batch ends with the tile or change that fills it
  publish(200);                            // returns, though nobody but the reader has taken anything
  follow(reader, replica, head_seq());
  EXPECT_EQ(difference_between(replica.lines(), story_.map()), std::nullopt);
}

TEST_F(BadClientsTest, one_too_many) {
  config_.most_clients = 3;
  start();
  std::vector<MapClient> clients;
  for (int i = 0; i < 3; ++i) clients.push_back(connect());
  MapClient fourth = open();
  expect_dismissed(fourth, Reason::too_many_clients);
  clients.pop_back();
  for (int i = 0; i < 100 && closed(Reason::unspecified) == 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_NO_THROW((void)connect());
}

TEST_F(BadClientsTest, random_bytes_never_disturb_a_subscriber) {
  start();
  MapClient reader = connect();
  ASSERT_TRUE(reader.send(wire::Subscribe{}));
  wire::MapReplica replica;
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    std::string bytes(1 + random() % 200, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    bytes[1] = bytes[2] = bytes[3] = '\0';
    MapClient client = open();
    (void)client.send_bytes(bytes);
    publish(1);
    follow(reader, replica, head_seq());
  }
  EXPECT_EQ(difference_between(replica.lines(), story_.map()), std::nullopt);
}

}  // namespace
}  // namespace roadvec
