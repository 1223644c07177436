#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstdlib>
#include <random>

#include "core/wire/frame_assembler.h"
#include "daemon/server/file_descriptor.h"
#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

std::string bytes_of_tile(const Tile& tile) {
  static std::vector<char> buffer(std::size_t{1} << 20);
  return std::string(wire::encode_frame(tile, buffer));
}

/// The map at every seq at which it was whole, tile by tile in bytes: what the log says, held against the story.
class Truth {
 public:
  struct State {
    std::uint64_t epoch = 0;
    Pose2 T_map_odom;
    std::map<TileKey, std::shared_ptr<const std::string>> tiles;
  };

  explicit Truth(const FrameLog& log)
      : log_(log), replica_(wire::MapReplica::empty_at(kStart.epoch, kStart.seq, kStart.T_map_odom)) {
    states_[kStart.seq] = {kStart.epoch, kStart.T_map_odom, {}};
  }

  void take_new(const VectorMap& map) {
    for (std::string frame; log_.read(position_, frame) == FrameLog::Outcome::frame;) take(frame);
    if (++taken_count_ % 8 == 0) {
      ASSERT_EQ(difference_between(replica_.lines(), map), std::nullopt);
    }
  }
  [[nodiscard]] const State* at(std::uint64_t seq) const {
    const auto found = states_.find(seq);
    return found == states_.end() ? nullptr : &found->second;
  }

 private:
  void take(const std::string& frame) {
    const auto message =
        wire::decode_envelope(std::string_view(frame).substr(wire::kFrameHeaderBytes), wire::Sender::server);
    ASSERT_TRUE(message);
    ASSERT_EQ(replica_.apply(*message), wire::MapReplica::Outcome::applied);
    if (const auto* delta = std::get_if<wire::Delta>(&*message)) {
      for (const TileDelta& tile : delta->tiles)
        now_.tiles[tile.key] = std::make_shared<const std::string>(bytes_of_tile(replica_.tiles().at(tile.key)));
    }
    now_.epoch = replica_.epoch();
    now_.T_map_odom = replica_.T_map_odom();
    if (replica_.consistent()) states_[replica_.seq()] = now_;
  }

  const FrameLog& log_;
  FrameLog::Position position_ = 0;
  wire::MapReplica replica_;
  int taken_count_ = 0;
  State now_;
  std::map<std::uint64_t, State> states_;
};

/// A client without manners. It checks its copy against the truth whenever the protocol says that it is whole, and
/// after a broken connection goes on as the protocol says that it may.
class Wanderer {
 public:
  Wanderer(unsigned seed, const std::string& path, const Truth& truth) : random_(seed), path_(path), truth_(truth) {}

  /// One thing out of all that it may do.
  void act() {
    if (sleep_turns_ > 0) {
      --sleep_turns_;
      return;
    }
    if (socket_.get() < 0) return connect();
    switch (random_() % 32) {
      case 0:
        return disconnect();
      case 2:
        return send_garbage();
      case 3:
        return send_half_a_frame();
      case 4:
        sleep_turns_ = static_cast<int>(random_() % 60);
        return;
      case 1:
      case 5:
        return ask_for_tiles();
      case 6:
        return subscribe();
      case 7:
        return send(wire::Ping{random_()});
      case 8:
        drip_turns_ = 50;
        [[fallthrough]];
      default:
        return read(drip_turns_ > 0 ? 1 : random_() % 3 == 0 ? 1 + random_() % 100 : 1 + random_() % 20'000);
    }
  }
  /// From here on a good client: until it has the map as of the seq.
  void reach(std::uint64_t seq) {
    const auto until = std::chrono::steady_clock::now() + kPatience;
    drip_turns_ = 0;
    half_sent_.clear();
    while (!(replica_.consistent() && replica_.seq() == seq)) {
      ASSERT_LT(std::chrono::steady_clock::now(), until) << "at " << replica_.seq() << " of " << seq;
      if (socket_.get() < 0 || !subscribed_) {
        disconnect();
        connect();
      }
      read(100'000);
      if (::testing::Test::HasFatalFailure()) return;
      std::this_thread::yield();
    }
  }
  void check_all() { check_copy(nullptr); }
  [[nodiscard]] const wire::MapReplica& replica() const { return replica_; }
  [[nodiscard]] bool follows_all() const { return !area_; }

  struct Seen {
    int checks = 0, answers = 0, snapshots = 0, incremental = 0, resumes = 0, overruns = 0, recuts = 0, ends = 0;
  };
  [[nodiscard]] const Seen& seen() const { return seen_; }

 private:
  void connect() {
    socket_ = FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof address.sun_path - 1);
    ASSERT_EQ(::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(::fcntl(socket_.get(), F_SETFL, O_NONBLOCK), 0);
    input_ = wire::FrameAssembler(wire::kMostServerBytes);
    send(wire::Hello{});
    subscribe();
  }
  void disconnect() {
    socket_ = FileDescriptor();
    subscribed_ = false;
    half_sent_.clear();
    answer_.reset();
    if (replica_.tiles().empty() || random_() % 8 == 0) forget();
  }
  /// The copy is thrown away; the next subscription begins anew.
  void forget() {
    replica_ = wire::MapReplica();
    area_.reset();
    if (random_() % 2 == 0) area_ = random_area();
  }
  wire::Area random_area() {
    const auto x_mm = static_cast<std::int32_t>(random_() % 1'500'000);
    return {x_mm, -1'000'000, x_mm + static_cast<std::int32_t>(random_() % 400'000), 1'000'000};
  }

  void subscribe() {
    wire::Subscribe request;
    request.area = area_;
    if (random_() % 4 == 0) request.max_rate_hz = 200;
    request.poses = random_() % 2 == 0;
    if (!subscribed_ && random_() % 4 != 0) request.resume = replica_.resume();
    if (random_() % 2 == 0) {
      request.known = replica_.known();
      request.known_epoch = replica_.epoch();
    }
    // On a connection that follows already, changes that were under way come first: what is known is known as of then.
    if (subscribed_) request.known.clear();
    send(request);
    subscribed_ = true;
  }
  void ask_for_tiles() {
    if (answer_) return;
    answer_.emplace();
    wire::GetTiles request;
    if (random_() % 2 == 0) request.area = answer_->area = random_area();
    send(request);
  }
  void send_garbage() {
    std::string bytes(1 + random_() % 40, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random_());
    send_bytes(bytes);
  }
  /// Or the rest of the one that it began.
  void send_half_a_frame() {
    if (half_sent_.empty()) {
      half_sent_ = std::string(wire::encode_frame(wire::Ping{random_()}, buffer_));
      send_bytes(half_sent_.substr(0, half_sent_.size() / 2));
    } else {
      const std::string rest = half_sent_.substr(half_sent_.size() / 2);
      half_sent_.clear();
      send_bytes(rest);
    }
  }
  void send(const auto& message) {
    if (half_sent_.empty()) send_bytes(std::string(wire::encode_frame(message, buffer_)));
  }
  void send_bytes(const std::string& bytes) {
    const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(bytes.size())) disconnect();
  }

  void read(std::size_t most_bytes) {
    if (drip_turns_ > 0) --drip_turns_;
    while (most_bytes > 0 && socket_.get() >= 0) {
      const std::span<char> space = input_.space();
      const ssize_t count = ::recv(socket_.get(), space.data(), std::min(most_bytes, space.size()), 0);
      if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
      if (count <= 0) return disconnect();
      most_bytes -= static_cast<std::size_t>(count);
      input_.received(static_cast<std::size_t>(count));
      while (const auto envelope = input_.next()) {
        take(*envelope);
        if (::testing::Test::HasFatalFailure() || socket_.get() < 0) return;
      }
      ASSERT_FALSE(input_.wrong_length());
    }
  }
  void take(std::string_view envelope) {
    const Expected<wire::Message> message = wire::decode_envelope(envelope, wire::Sender::server);
    ASSERT_TRUE(message) << message.error().message;
    count(*message);
    if (std::holds_alternative<wire::Bye>(*message)) return disconnect();
    if (const auto* tiles = std::get_if<wire::Tiles>(&*message)) return take_answer(*tiles);
    const bool was_receiving = !replica_.resume();
    const wire::MapReplica::Outcome outcome = replica_.apply(*message);
    ASSERT_NE(outcome, wire::MapReplica::Outcome::out_of_order)
        << "message " << message->index() << " at " << replica_.seq();
    if (was_receiving && std::holds_alternative<wire::Overrun>(*message)) ++seen_.recuts;
    if (!replica_.consistent() || outcome != wire::MapReplica::Outcome::applied) return;
    const auto* delta = std::get_if<wire::Delta>(&*message);
    check_copy(++seen_.checks % 16 != 0 ? delta : nullptr);
  }
  void count(const wire::Message& message) {
    if (const auto* begin = std::get_if<wire::SnapshotBegin>(&message)) {
      ++seen_.snapshots;
      seen_.incremental += begin->incremental ? 1 : 0;
    }
    seen_.resumes += std::holds_alternative<wire::Resumed>(message) ? 1 : 0;
    seen_.overruns += std::holds_alternative<wire::Overrun>(message) ? 1 : 0;
    seen_.ends += std::holds_alternative<wire::Bye>(message) ? 1 : 0;
  }

  /// All of it, or the tiles of this delta.
  void check_copy(const wire::Delta* delta) {
    const Truth::State* state = truth_.at(replica_.seq());
    ASSERT_NE(state, nullptr) << "the map was not whole at " << replica_.seq();
    ASSERT_EQ(replica_.epoch(), state->epoch) << "at " << replica_.seq();
    ASSERT_EQ(replica_.T_map_odom(), state->T_map_odom) << "at " << replica_.seq();
    if (delta == nullptr) return expect_tiles(replica_.tiles(), *state, area_);
    for (const TileDelta& tile : delta->tiles)
      ASSERT_EQ(bytes_of_tile(replica_.tiles().at(tile.key)), *state->tiles.at(tile.key)) << "at " << replica_.seq();
  }
  void take_answer(const wire::Tiles& part) {
    ASSERT_TRUE(answer_);
    for (const Tile& tile : part.tiles) answer_->tiles[tile.key] = tile;
    if (part.more) return;
    ++seen_.answers;
    const Truth::State* state = truth_.at(part.as_of_seq);
    ASSERT_NE(state, nullptr);
    ASSERT_EQ(part.epoch, state->epoch);
    expect_tiles(answer_->tiles, *state, answer_->area);
    answer_.reset();
  }
  static void expect_tiles(const std::map<TileKey, Tile>& tiles, const Truth::State& state,
                           const std::optional<wire::Area>& area) {
    std::size_t expected_count = 0;
    for (const auto& [key, bytes] : state.tiles) {
      if (area && !area->touches(key)) continue;
      ++expected_count;
      const auto found = tiles.find(key);
      ASSERT_NE(found, tiles.end()) << "tile " << key.ix << ", " << key.iy;
      ASSERT_EQ(bytes_of_tile(found->second), *bytes) << "tile " << key.ix << ", " << key.iy;
    }
    ASSERT_EQ(tiles.size(), expected_count);
  }

  struct Answer {
    std::optional<wire::Area> area;
    std::map<TileKey, Tile> tiles;
  };

  std::mt19937 random_;
  std::string path_;
  const Truth& truth_;
  FileDescriptor socket_{-1};
  wire::FrameAssembler input_{wire::kMostServerBytes};
  std::vector<char> buffer_ = std::vector<char>(std::size_t{1} << 16);
  std::string half_sent_;
  bool subscribed_ = false;
  int sleep_turns_ = 0, drip_turns_ = 0;
  wire::MapReplica replica_;
  std::optional<wire::Area> area_;
  std::optional<Answer> answer_;
  Seen seen_;
};

int count_from(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

/// Snapshot and changes are the server's map, or the client has been told: for clients that connect, stall, read byte
/// by byte, send garbage and half frames, leave and come back, while the map grows and loops close. ROADVEC_SEEDS=1000
/// for longer.
class ClientsNeverMiss : public MapSocket {
 protected:
  void wander(unsigned seed) {
    std::mt19937 random(seed);
    story_ = MapStory(seed, 100);
    full_frame_bytes_ = seed % 2 == 0 ? std::size_t{4} << 10 : std::size_t{256} << 10;
    config_.stall_timeout_s = config_.half_frame_timeout_s = 0.15;
    config_.farewell_s = 0.1;
    config_.send_buffer_bytes = 4096;
    config_.facts.batch_bytes = std::size_t{1} << (9 + seed % 2 * 7);
    start(std::size_t{1} << (17 + seed % 3 * 2));
    Truth truth(*log_);
    std::vector<Wanderer> clients;
    for (int i = 0; i < 10; ++i) clients.emplace_back(random(), config_.socket_path, truth);
    for (int round = 0; round < 1500; ++round) {
      if (random() % 6 == 0) {
        for (auto steps = random() % 12 == 0 ? 1 + random() % 40 : 1; steps > 0; --steps) {
          publish(1);
          truth.take_new(story_.map());
        }
      }
      clients[random() % clients.size()].act();
      if (HasFatalFailure()) return;
    }
    for (Wanderer& client : clients) {
      client.reach(head_seq());
      client.check_all();
      if (HasFatalFailure()) return;
      if (client.follows_all()) {
        EXPECT_EQ(difference_between(client.replica().lines(), story_.map()), std::nullopt);
      }
      add(client.seen());
    }
    stop();
    EXPECT_TRUE(served_to_the_end_);
  }
  void add(const Wanderer::Seen& s) {
    all_.checks += s.checks, all_.answers += s.answers, all_.snapshots += s.snapshots;
    all_.incremental += s.incremental, all_.resumes += s.resumes, all_.overruns += s.overruns;
    all_.recuts += s.recuts, all_.ends += s.ends;
  }

  Wanderer::Seen all_;
};

TEST_F(ClientsNeverMiss, whatever_they_and_the_map_do) {
  const int seeds = count_from("ROADVEC_SEEDS", 4);
  for (int seed = 1; seed <= seeds; ++seed) {
    wander(static_cast<unsigned>(seed));
    ASSERT_FALSE(HasFatalFailure()) << "seed " << seed;
    stop();
  }
  std::printf(
      "%d checks of a whole copy, %d answers, %d snapshots (%d of them incremental), %d resumed, %d overruns (%d in "
      "the "
      "middle of a snapshot), %d dismissed\n",
      all_.checks, all_.answers, all_.snapshots, all_.incremental, all_.resumes, all_.overruns, all_.recuts, all_.ends);
  // The test means nothing if the wanderers have not seen it all.
  EXPECT_GT(all_.checks, 500);
  EXPECT_GT(std::min({all_.answers, all_.snapshots, all_.incremental, all_.resumes, all_.overruns, all_.recuts}), 0);
  EXPECT_GT(all_.ends, 0);
}

}  // namespace
}  // namespace roadvec
