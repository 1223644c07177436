#include "daemon/server/conversation.h"

#include <algorithm>
#include <set>

namespace roadvec {
namespace {

/// A batch of changes, or a Tiles frame, is closed when it holds this much: 64 kB keeps a socket buffer full.
constexpr std::size_t kBatchBytes = std::size_t{64} << 10;
constexpr std::size_t kBatchVertices = 50'000;

wire::Bye bye(wire::Bye::Reason reason, std::string text) { return {reason, std::move(text)}; }

bool is_known(const std::map<TileKey, std::uint32_t>& known, const Tile& tile) {
  const auto found = known.find(tile.key);
  return found != known.end() && found->second == tile.revision;
}

std::map<TileKey, std::uint32_t> revisions(const std::vector<wire::KnownTile>& tiles) {
  std::map<TileKey, std::uint32_t> known;
  for (const wire::KnownTile& tile : tiles) known[tile.key] = tile.revision;
  return known;
}

std::size_t vertex_count(const Tile& tile) {
  std::size_t count = 1;
  for (const TilePiece& piece : tile.pieces) count += piece.vertices.size();
  return count;
}

wire::Area square_around(const Pose2& T_map_vehicle, double half_edge_m) {
  return {mm_from_m(T_map_vehicle.x_m - half_edge_m), mm_from_m(T_map_vehicle.y_m - half_edge_m),
          mm_from_m(T_map_vehicle.x_m + half_edge_m), mm_from_m(T_map_vehicle.y_m + half_edge_m)};
}

}  // namespace

std::optional<wire::Bye> Conversation::answer(Session& session, std::string_view envelope, double now_s) {
  using enum wire::Bye::Reason;
  ++request_count_;
  const Expected<wire::Message> message = wire::decode_envelope(envelope, wire::Sender::client);
  if (!message) return bye(malformed, message.error().message);
  const bool is_hello = std::holds_alternative<wire::Hello>(*message);
  if (is_hello != (session.state == Session::State::awaiting_hello)) {
    return bye(unexpected_message, is_hello ? "Hello a second time" : "a request before Hello");
  }
  return std::visit([&](const auto& m) { return take(session, m, now_s); }, *message);
}

Conversation::Ending Conversation::take(Session& session, const wire::Hello& hello, double now_s) {
  if (hello.proto_major != wire::kProtoMajor) {
    return bye(wire::Bye::Reason::protocol_version,
               "this server speaks protocol major " + std::to_string(wire::kProtoMajor));
  }
  wire::Welcome welcome;
  welcome.epoch = map_.head().epoch;
  welcome.head_seq = map_.head().seq;
  welcome.oldest_seq = map_.oldest_seq();
  welcome.anchor = facts_.anchor;
  welcome.T_map_odom = map_.replica().T_map_odom();
  welcome.server_version = facts_.server_version;
  reply(session, welcome, now_s);
  session.enter(Session::State::greeted, now_s);
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const wire::GetTiles& request, double now_s) {
  if (request.around_vehicle_m > 0 && !pose_) {
    reply(session, wire::Error{wire::Error::Code::unavailable, "the vehicle's pose is not known yet"}, now_s);
    return std::nullopt;
  }
  const Pose2 T_map_vehicle = pose_ ? map_.replica().T_map_odom() * pose_->T_odom_vehicle : Pose2{};
  wire::Tiles part{map_.head().epoch, map_.head().seq, {}, true};
  std::size_t vertices = 0;
  for (const TileKey key : chosen(request, T_map_vehicle)) {
    const Tile& tile = map_.replica().tiles().at(key);
    const std::size_t more_vertices = vertex_count(tile);
    if (!part.tiles.empty() && vertices + more_vertices > kBatchVertices) {
      reply(session, part, now_s);
      part.tiles.clear();
      vertices = 0;
    }
    part.tiles.push_back(tile);
    vertices += more_vertices;
  }
  part.more = false;
  reply(session, part, now_s);
  return std::nullopt;
}

std::vector<TileKey> Conversation::chosen(const wire::GetTiles& request, const Pose2& T_map_vehicle) const {
  std::optional<wire::Area> area = request.area;
  if (request.around_vehicle_m > 0) area = square_around(T_map_vehicle, request.around_vehicle_m);
  const std::set<TileKey> named(request.keys.begin(), request.keys.end());
  const auto known = map_.knows(request.known_epoch) ? revisions(request.known) : std::map<TileKey, std::uint32_t>{};
  std::vector<TileKey> keys;
  for (const auto& [key, tile] : map_.replica().tiles()) {
    if (area && !area->touches(key)) continue;
    if (!named.empty() && !named.contains(key)) continue;
    if (!is_known(known, tile)) keys.push_back(key);
  }
  return keys;
}

Conversation::Ending Conversation::take(Session& session, const wire::Subscribe& request, double now_s) {
  Session::Following following;
  following.area = request.area;
  following.interval_s = request.max_rate_hz > 0 ? 1 / request.max_rate_hz : 0;
  following.poses = request.poses;
  following.status = request.status;
  session.following = following;
  if (!request.resume || !map_.knows(request.resume->epoch, request.resume->seq)) {
    snapshot(session, request, now_s);
  } else {
    session.following->seq = request.resume->seq;
    if (map_.change(request.resume->seq + 1) || caught_up(session)) {
      reply(session, wire::Resumed{request.resume->seq + 1}, now_s);
    } else {
      overrun(session, now_s);
    }
  }
  return std::nullopt;
}

void Conversation::snapshot(Session& session, const wire::Subscribe& request, double now_s) {
  const bool incremental = map_.knows(request.known_epoch) && !request.known.empty();
  const auto known = incremental ? revisions(request.known) : std::map<TileKey, std::uint32_t>{};
  std::vector<TileKey> keys;
  for (const auto& [key, tile] : map_.replica().tiles()) {
    if ((!request.area || request.area->touches(key)) && !is_known(known, tile)) keys.push_back(key);
  }
  reply(session,
        wire::SnapshotBegin{map_.head().epoch, map_.head().seq, map_.replica().T_map_odom(),
                            static_cast<std::uint32_t>(keys.size()), incremental},
        now_s);
  end_snapshot(session, keys, now_s);
}

void Conversation::overrun(Session& session, double now_s) {
  ++overrun_count_;
  const std::uint64_t seq = session.following->seq;
  std::vector<TileKey> keys;
  for (const auto& [key, tile] : map_.replica().tiles()) {
    if ((!session.following->area || session.following->area->touches(key)) && map_.last_seq(key) > seq)
      keys.push_back(key);
  }
  reply(session, wire::Overrun{map_.head().epoch, seq + 1, map_.head().seq, static_cast<std::uint32_t>(keys.size())},
        now_s);
  end_snapshot(session, keys, now_s);
}

void Conversation::end_snapshot(Session& session, const std::vector<TileKey>& keys, double now_s) {
  for (const TileKey key : keys) session.queue(map_.tile_frame(key), now_s);
  reply(session, wire::SnapshotEnd{map_.head().epoch, map_.head().seq, map_.replica().T_map_odom()}, now_s);
  session.following->seq = map_.head().seq;
}

Conversation::Ending Conversation::take(Session& session, const wire::GetStatus&, double now_s) {
  if (status_) {
    session.queue(status_, now_s);
  } else {
    reply(session, wire::Error{wire::Error::Code::unavailable, "no status yet"}, now_s);
  }
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const wire::Ping& ping, double now_s) {
  reply(session, wire::Pong{ping.nonce}, now_s);
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const auto&, double now_s) {
  reply(session, wire::Error{wire::Error::Code::unsupported, "this server does not answer this request"}, now_s);
  return std::nullopt;
}

bool Conversation::caught_up(const Session& session) const {
  return !session.following || session.following->seq == map_.head().seq;
}

bool Conversation::follow(Session& session, double now_s, bool hurry) {
  if (caught_up(session) || !map_.replica().consistent()) return false;
  Session::Following& following = *session.following;
  if (!hurry && now_s < following.next_changes_s) return false;
  for (std::size_t bytes = 0; bytes < kBatchBytes && !caught_up(session);) {
    const SharedFrame change = map_.change(following.seq + 1);
    if (!change) {
      overrun(session, now_s);
      break;
    }
    bytes += change->size();
    session.queue(in_area(change, following.area), now_s);
    ++following.seq;
  }
  if (caught_up(session)) following.next_changes_s = now_s + following.interval_s;
  return true;
}

SharedFrame Conversation::in_area(const SharedFrame& change, const std::optional<wire::Area>& area) {
  if (!area) return change;
  Expected<wire::Message> message =
      wire::decode_envelope(std::string_view(*change).substr(wire::kFrameHeaderBytes), wire::Sender::server);
  auto* delta = message ? std::get_if<wire::Delta>(&*message) : nullptr;
  if (delta == nullptr) return change;
  std::erase_if(delta->tiles, [&](const TileDelta& tile) { return !area->touches(tile.key); });
  return map_.encoder().encode(*delta);
}

}  // namespace roadvec
