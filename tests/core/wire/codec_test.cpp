#include "core/wire/codec.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <protozero/pbf_reader.hpp>
#include <protozero/pbf_writer.hpp>
#include <vector>

#include "core/wire/frame_assembler.h"

namespace roadvec::wire {
namespace {

TilePiece piece() {
  TilePiece p;
  p.line = 300;
  p.revision = 4;
  p.attributes = {BoundaryKind::barrier, EndKind::open, EndKind::occluded, 0.85F, 0.975F, 21};
  p.first_seen.ns = 1'300'000'000'000'000'001;
  p.last_seen.ns = 1'300'000'002'000'000'000;
  p.first_vertex = 3;
  p.line_vertex_count = 9;
  p.vertices = {{-64'500, 70'000, -120, 850, 12, 400},
                {-63'000, 70'010, -120, 850, 15, 400},
                {-50'000, 71'000, -118, 851, 15, 400}};
  return p;
}
Tile tile() { return {{-1, 1}, 6, {piece()}}; }
TileDelta tile_delta() { return {{-1, 1}, 7, {piece()}, {12, 300'000'000'000}}; }

/// One message of each kind, every field set.
std::map<std::string, Message> samples() {
  const Pose2 a{1.5, -2.25, 0.125}, b{-3, 4, -0.5};
  const Area area{-64'000, 0, 64'000, 128'000};
  Welcome welcome{1, 0, 0xC0FFEE, 17, 3, Anchor{49.0, 8.4, 112.0, -70.98}, a, "1.2.3", 64'000};
  Delta delta{0xC0FFEE, 18, {1'300'000'000'100'000'000}, a, {tile_delta()}, {{12, {300, 301}}, {13, {}}}, true};
  Pose pose{{1'300'000'000'100'000'000}, 0xC0FFEE, a, b, a, PoseCovariance::Zero(), 8.25, -0.0625};
  pose.covariance << 1, 0.5, 0.25, 0.5, 2, 0.125, 0.25, 0.125, 3;
  Status status{{1'300'000'000'100'000'000},
                "1.2.3",
                "degraded",
                "CAN is silent",
                0xC0FFEE,
                18,
                16,
                100,
                2,
                40,
                12,
                812.5,
                1000.25,
                60.5,
                {{"lidar",
                  "ok",
                  {{"packets_received", 12'345}},
                  {{"rate_hz", 9.875}},
                  {{"decode", 1234, 7.5, 9.25, 20, 9000.5, {3, 1200, 1234}}},
                  "9.9 sweeps a second"}},
                pose};
  return {{"hello", Hello{1, 0, "planner", 5}},
          {"welcome", welcome},
          {"get_tiles", GetTiles{area, 50, {{-1, 1}, {0, 0}}, {{{-1, 1}, 6}}, 0xC0FFEE}},
          {"tiles", Tiles{0xC0FFEE, 18, {tile(), {{0, 0}, 1, {}}}, true}},
          {"subscribe", Subscribe{area, Resume{0xC0FFEE, 17}, {{{-1, 1}, 6}}, 0xC0FFEE, 12.5, true, true}},
          {"snapshot_begin", SnapshotBegin{0xC0FFEE, 17, a, 2, true}},
          {"tile", tile()},
          {"snapshot_end", SnapshotEnd{0xC0FFEE, 17, a}},
          {"resumed", Resumed{18}},
          {"delta", delta},
          {"epoch_change",
           EpochChange{EpochChange::Reason::loop_closure, 0xC0FFEE, 0xC0FFEF, 19, {1'300'000'000'200'000'000}, a, b}},
          {"overrun", Overrun{0xC0FFEF, 20, 90, 4, a}},
          {"pose", pose},
          {"status", status},
          {"get_status", GetStatus{}},
          {"heartbeat", Heartbeat{0xC0FFEF, 90}},
          {"bye", Bye{Bye::Reason::stalled, "not reading"}},
          {"error", Error{Error::Code::unavailable, "no pose"}},
          {"ping", Ping{77}},
          {"pong", Pong{77}},
          {"get_metrics", GetMetrics{}},
          {"metrics", Metrics{"# EOF\n"}},
          {"command", Command{std::nullopt, std::nullopt, ImportMap{"/tmp/map.gpkg"}}},
          {"command_result", CommandResult{true, "imported", 16}}};
}

std::string frame_of(const Message& message) {
  std::vector<char> buffer(1 << 16);
  return std::visit(
      [&](const auto& m) {
        if constexpr (std::is_same_v<std::decay_t<decltype(m)>, Unknown>) {
          return std::string();
        } else {
          return std::string(encode_frame(m, buffer));
        }
      },
      message);
}

Expected<Message> decoded(const std::string& frame) {
  const std::string_view envelope = std::string_view(frame).substr(kFrameHeaderBytes);
  const Expected<Message> from_server = decode_envelope(envelope, Sender::server);
  return from_server ? from_server : decode_envelope(envelope, Sender::client);
}

std::string hex(std::string_view bytes) {
  std::string text;
  for (const char byte : bytes) {
    text += "0123456789abcdef"[static_cast<unsigned char>(byte) >> 4];
    text += "0123456789abcdef"[static_cast<unsigned char>(byte) & 15];
  }
  return text;
}

TEST(Codec, every_message_keeps_every_field) {
  const auto messages = samples();
  EXPECT_EQ(messages.size() + 1, std::variant_size_v<Message>) << "a kind without a sample";
  for (const auto& [name, message] : messages) {
    const std::string frame = frame_of(message);
    ASSERT_GT(frame.size(), kFrameHeaderBytes) << name;
    EXPECT_EQ(envelope_length(frame.data()), frame.size() - kFrameHeaderBytes) << name;
    const Expected<Message> again = decoded(frame);
    ASSERT_TRUE(again) << name << ": " << again.error().message;
    EXPECT_EQ(again->index(), message.index()) << name;
    EXPECT_EQ(hex(frame_of(*again)), hex(frame)) << name;
  }
  EXPECT_EQ(std::get<Tile>(*decoded(frame_of(tile()))), tile());
  EXPECT_EQ(std::get<Delta>(*decoded(frame_of(samples().at("delta")))).tiles[0], tile_delta());
}

using Golden = std::map<std::string, std::string>;

std::string golden_path(std::uint32_t minor) {
  return ROADVEC_TEST_DATA "/wire/frames_v1." + std::to_string(minor) + ".hex";
}

/// Frames in hexadecimal, by the name of their message.
Golden golden_frames(std::uint32_t minor) {
  std::ifstream file(golden_path(minor));
  Golden golden;
  for (std::string name, bytes; file >> name >> bytes;) golden[name] = bytes;
  return golden;
}

std::string bytes_from(const std::string& hex_text) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex_text.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hex_text.substr(i, 2), nullptr, 16));
  return bytes;
}

/// A new minor gets samples of its new fields and a file of its own: ROADVEC_WRITE_GOLDEN=1 writes that of this minor,
/// as long as it is not released.
TEST(Codec, frames_are_those_of_this_minors_golden_file) {
  if (std::getenv("ROADVEC_WRITE_GOLDEN") != nullptr) {
    std::ofstream file(golden_path(kProtoMinor));
    for (const auto& [name, message] : samples()) file << name << " " << hex(frame_of(message)) << "\n";
  }
  Golden golden = golden_frames(kProtoMinor);
  for (const auto& [name, message] : samples()) EXPECT_EQ(hex(frame_of(message)), golden[name]) << name;
}

/// A client or a server of years ago is understood, and understands: its bytes are read, and what it knows of is
/// written as it always was.
TEST(Codec, frames_of_every_minor_so_far_are_read_and_written_again_the_same) {
  for (std::uint32_t minor = 0; minor <= kProtoMinor; ++minor) {
    const Golden golden = golden_frames(minor);
    EXPECT_EQ(golden.size() + 1, std::variant_size_v<Message>) << golden_path(minor);
    for (const auto& [name, bytes] : golden) {
      const Expected<Message> message = decoded(bytes_from(bytes));
      ASSERT_TRUE(message) << "1." << minor << " " << name << ": " << message.error().message;
      EXPECT_EQ(message->index(), samples().at(name).index()) << "1." << minor << " " << name;
      EXPECT_EQ(hex(frame_of(*message)), bytes) << "1." << minor << " " << name;
    }
  }
}

TEST(Codec, fields_of_a_later_minor_are_skipped_in_every_message) {
  const std::string later("\xFA\x3F\x04next", 7);  // field 1023: four bytes
  for (const auto& [name, message] : samples()) {
    const std::string frame = frame_of(message);
    const protozero::pbf_tag_type number = static_cast<protozero::pbf_tag_type>(message.index());
    protozero::pbf_reader reader(frame.data() + kFrameHeaderBytes, frame.size() - kFrameHeaderBytes);
    ASSERT_TRUE(reader.next(number));
    std::string body = reader.get_string(), extended(kFrameHeaderBytes, '\0');
    protozero::pbf_writer(extended).add_bytes(number, body + later);
    const Expected<Message> again = decoded(extended);
    ASSERT_TRUE(again) << name << ": " << again.error().message;
    EXPECT_EQ(hex(frame_of(*again)), hex(frame)) << name;
  }
}

TEST(Codec, a_frame_that_does_not_fit_is_not_written) {
  const Message message = samples().at("delta");
  const std::size_t size = frame_of(message).size();
  for (std::size_t room = 0; room < size; ++room) {
    std::vector<char> buffer(room);
    EXPECT_TRUE(encode_frame(std::get<Delta>(message), buffer).empty()) << room;
  }
}

TEST(Codec, any_prefix_and_any_flipped_byte_is_read_or_refused_but_never_more) {
  for (const auto& [name, message] : samples()) {
    const std::string frame = frame_of(message);
    for (std::size_t i = kFrameHeaderBytes; i < frame.size(); ++i) {
      (void)decoded(frame.substr(0, i));
      for (const int flip : {0x01, 0x80, 0xFF}) {
        std::string bad = frame;
        bad[i] = static_cast<char>(bad[i] ^ flip);
        if (const auto read = decoded(bad)) (void)frame_of(*read);
      }
    }
  }
}

TEST(Codec, unknown_fields_are_skipped_and_unknown_messages_named_unknown) {
  std::string frame = frame_of(Ping{5});
  std::string extended = frame.substr(kFrameHeaderBytes);
  extended[extended.size() - 3] = static_cast<char>(extended[extended.size() - 3] + 3);  // the Ping's length
  extended += "\x7A\x01x";                                                               // its field 15
  const auto ping = decode_envelope(extended, Sender::client);
  ASSERT_TRUE(ping) << ping.error().message;
  EXPECT_EQ(std::get<Ping>(*ping).nonce, 5U);
  const auto later = decode_envelope(std::string("\xFA\x3F\x00", 3), Sender::client);
  ASSERT_TRUE(later);
  EXPECT_TRUE(std::holds_alternative<Unknown>(*later));
}

TEST(Codec, an_absent_version_is_version_0) {
  const std::string none("\x0A\x00", 2),
      zero("\x0A\x0D\x08\x00\x1A\x07planner \x05", 15);  // the second one found by fuzzing
  for (const std::string& envelope : {none, zero}) {
    const auto hello = decode_envelope(envelope, Sender::client);
    ASSERT_TRUE(hello) << hello.error().message;
    EXPECT_EQ(std::get<Hello>(*hello).proto_major, 0U);
  }
}

TEST(Codec, a_flag_without_its_byte_is_refused) {
  // SnapshotBegin that ends behind the tag of `incremental`, in memory of exactly that size, so that a sanitizer sees
  // one byte more.
  const std::vector<char> envelope = {0x32, 0x01, 0x28};
  EXPECT_FALSE(decode_envelope({envelope.data(), envelope.size()}, Sender::server));
}

TEST(Codec, what_cannot_be_is_refused) {
  const auto refused = [](const Tile& t) { return !decoded(frame_of(t)); };
  Tile t = tile();
  t.pieces[0].first_vertex = 7;
  EXPECT_TRUE(refused(t)) << "more vertices than the line has";
  t = tile();
  t.pieces[0].vertices.clear();
  EXPECT_TRUE(refused(t)) << "a piece of nothing";
  t = tile();
  t.key = {2'000'000'000 / kTileSize_mm, 0};
  EXPECT_TRUE(refused(t)) << "farther than the farthest";
  Pose pose;
  pose.speed_mps = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(decoded(frame_of(pose)));
  EXPECT_FALSE(decode_envelope(std::string_view(frame_of(Bye{})).substr(kFrameHeaderBytes), Sender::client))
      << "clients send no Bye";
}

TEST(Codec, a_piece_costs_a_few_bytes_per_vertex) {
  Tile t{{0, 0}, 1, {piece()}};
  t.pieces[0].first_vertex = 0;
  t.pieces[0].line_vertex_count = 30;
  t.pieces[0].vertices.clear();
  for (std::int32_t i = 0; i < 30; ++i)
    t.pieces[0].vertices.push_back({2000 * i, 31'000 + 7 * (i % 5), i, 120, 20 + i % 2, 400});
  EXPECT_LE(frame_of(t).size(), 30 * 6 + 70);
}

TEST(FrameAssembler, cuts_frames_out_of_single_bytes_and_out_of_many_at_once) {
  std::string stream;
  for (std::uint64_t i = 1; i <= 100; ++i) stream += frame_of(Ping{i * 1'000'000});
  for (const std::size_t step : {std::size_t{1}, std::size_t{7}, stream.size()}) {
    FrameAssembler assembler(kMostClientBytes);
    std::uint64_t count = 0;
    for (std::size_t at = 0; at < stream.size();) {
      const std::span<char> space = assembler.space();
      const std::size_t length = std::min({step, space.size(), stream.size() - at});
      std::copy_n(stream.data() + at, length, space.data());
      assembler.received(length);
      at += length;
      while (const auto envelope = assembler.next()) {
        EXPECT_EQ(std::get<Ping>(*decode_envelope(*envelope, Sender::client)).nonce, ++count * 1'000'000);
      }
    }
    EXPECT_EQ(count, 100U);
    EXPECT_FALSE(assembler.has_bytes());
  }
}

TEST(FrameAssembler, refuses_lengths_of_nothing_and_of_too_much) {
  for (const std::uint32_t length : {0U, 1001U, 0xFFFFFFFFU}) {
    FrameAssembler assembler(1000);
    std::memcpy(assembler.space().data(), &length, sizeof length);
    assembler.received(sizeof length);
    EXPECT_TRUE(assembler.wrong_length()) << length;
    EXPECT_FALSE(assembler.next());
  }
}

}  // namespace
}  // namespace roadvec::wire
