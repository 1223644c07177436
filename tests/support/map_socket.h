#pragma once

#include <gtest/gtest.h>

#include <thread>

#include "core/wire/map_replica.h"
#include "daemon/server/client.h"
#include "daemon/server/map_publisher.h"
#include "daemon/server/map_server.h"
#include "tests/support/map_story.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {

inline constexpr MapHead kStart{0xC0FFEE, 0};
inline constexpr MapClient::Seconds kPatience{20};

/// A MapServer that runs in a thread of its own on a socket in a temporary folder, and a MapStory published by the
/// test's thread.
class MapSocket : public ::testing::Test {
 protected:
  MapSocket() {
    config_.socket_path = (folder_ / "map.sock").string();
    config_.start = kStart;
    config_.facts.server_version = "0.0-test";
    config_.facts.anchor = Anchor{49.0, 8.4, 112.0, -70.98};
    config_.most_clients_per_user = 64;
  }
  ~MapSocket() override { stop(); }

  void start(std::size_t log_bytes = std::size_t{4} << 20) {
    server_.reset();  // it reads the log
    log_ = std::make_unique<FrameLog>(log_bytes);
    publisher_ = std::make_unique<MapPublisher>(*log_, kStart, full_frame_bytes_);
    server_ = std::make_unique<MapServer>(config_, *log_, poses_, [] {
      wire::Status status;
      status.state = "mapping";
      return status;
    });
    thread_ = std::jthread([this](std::stop_token token) { served_to_the_end_ = server_->run(token); });
  }
  void stop() {
    if (!thread_.joinable()) return;
    thread_.request_stop();
    thread_.join();
  }
  void publish(int steps) {
    for (int i = 0; i < steps; ++i) {
      const MapChange change = story_.step();
      publisher_->publish(change, story_.map(), [&](std::size_t bytes) {
        while (!log_->has_room(bytes)) std::this_thread::yield();
      });
    }
  }

  [[nodiscard]] MapClient connect() {
    Expected<MapClient> client = MapClient::connect(config_.socket_path, "test", kPatience);
    if (!client) throw std::runtime_error(client.error().message);
    return std::move(*client);
  }
  /// Applies what the server sends until the copy is whole and has reached the seq.
  static void follow(MapClient& client, wire::MapReplica& replica, std::uint64_t until_seq) {
    while (replica.seq() < until_seq || !replica.consistent()) {
      const Expected<wire::Message> message = client.receive(kPatience);
      ASSERT_TRUE(message) << message.error().message;
      ASSERT_NE(replica.apply(*message), wire::MapReplica::Outcome::out_of_order);
      ASSERT_FALSE(std::holds_alternative<wire::Bye>(*message)) << std::get<wire::Bye>(*message).text;
    }
  }
  /// What the server says at last.
  static wire::Bye farewell(MapClient& client) {
    const Expected<wire::Bye> bye = client.receive_one<wire::Bye>(kPatience);
    EXPECT_TRUE(bye) << bye.error().message;
    return bye ? *bye : wire::Bye{};
  }
  [[nodiscard]] std::uint64_t closed(wire::Bye::Reason reason) const {
    return server_->counters().closed_count[static_cast<std::size_t>(reason)].load();
  }
  [[nodiscard]] std::uint64_t head_seq() const { return publisher_->head().seq; }

  TemporaryFolder folder_;
  MapServerConfig config_;
  Latest<PoseReport> poses_;
  MapStory story_{1};
  std::size_t full_frame_bytes_ = std::size_t{256} << 10;
  std::unique_ptr<FrameLog> log_;
  std::unique_ptr<MapPublisher> publisher_;
  std::unique_ptr<MapServer> server_;
  bool served_to_the_end_ = false;
  std::jthread thread_;
};

}  // namespace roadvec
