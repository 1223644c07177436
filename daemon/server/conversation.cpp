#include "daemon/server/conversation.h"

#include <algorithm>
#include <set>

#include "daemon/server/metrics.h"

namespace roadvec {
namespace {

constexpr std::size_t kMostNameBytes = 256;

wire::Bye bye(wire::Bye::Reason reason, std::string text) { return {reason, std::move(text)}; }

wire::Area square_around(const Pose2& T_map_vehicle, double half_edge_m) {
  return {mm_from_m(T_map_vehicle.x_m - half_edge_m), mm_from_m(T_map_vehicle.y_m - half_edge_m),
          mm_from_m(T_map_vehicle.x_m + half_edge_m), mm_from_m(T_map_vehicle.y_m + half_edge_m)};
}

bool is_empty(const std::optional<wire::Area>& area) {
  return area && (area->x_min_mm > area->x_max_mm || area->y_min_mm > area->y_max_mm);
}

}  // namespace

std::optional<wire::Bye> Conversation::answer(Session& session, std::string_view envelope, double now_s) {
  using enum wire::Bye::Reason;
  ++counts_.requests;
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
  if (hello.client_name.size() > kMostNameBytes)
    return bye(wire::Bye::Reason::malformed, "a name of more than 256 bytes");
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
  if (is_empty(request.area)) {
    refuse(session, wire::Error::Code::invalid, "an area whose corners are swapped", now_s);
    return std::nullopt;
  }
  if (request.around_vehicle_m > 0 && !pose_) {
    refuse(session, wire::Error::Code::unavailable, "the vehicle's pose is not known yet", now_s);
    return std::nullopt;
  }
  Session::Delivery& delivery = session.delivery.emplace(Session::Delivery{});
  delivery.answers = true;
  delivery.area = request.area;
  if (request.around_vehicle_m > 0)
    delivery.area = square_around(map_.head().T_map_odom * pose_->T_odom_vehicle, request.around_vehicle_m);
  delivery.named.insert(request.keys.begin(), request.keys.end());
  choose(delivery, request.known, request.known_epoch);
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const wire::Subscribe& request, double now_s) {
  if (is_empty(request.area)) {
    refuse(session, wire::Error::Code::invalid, "an area whose corners are swapped", now_s);
    return std::nullopt;
  }
  Session::Following& following = session.following.emplace(Session::Following{});
  following.area = request.area;
  following.interval_s = request.max_rate_hz > 0 ? 1 / request.max_rate_hz : 0;
  following.poses = request.poses;
  following.status = request.status;
  if (!request.resume || !map_.knows(request.resume->epoch, request.resume->seq)) {
    snapshot(session, request, now_s);
    return std::nullopt;
  }
  following.seq = request.resume->seq;
  if (caught_up(session) || map_.change(following.seq + 1)) {
    reply(session, wire::Resumed{following.seq + 1}, now_s);
  } else {
    overrun(session, now_s);
  }
  return std::nullopt;
}

void Conversation::snapshot(Session& session, const wire::Subscribe& request, double now_s) {
  Session::Delivery& delivery = session.delivery.emplace(Session::Delivery{});
  delivery.area = request.area;
  choose(delivery, request.known, request.known_epoch);
  const bool incremental = map_.knows(request.known_epoch) && !request.known.empty();
  reply(session,
        wire::SnapshotBegin{delivery.cut.epoch, delivery.cut.seq, delivery.cut.T_map_odom,
                            static_cast<std::uint32_t>(delivery.keys.size()), incremental},
        now_s);
}

/// The tiles that the delivery covers and the client does not know, as of now.
void Conversation::choose(Session::Delivery& delivery, const std::vector<wire::KnownTile>& known,
                          std::uint64_t known_epoch) const {
  std::map<TileKey, std::uint32_t> revisions;
  if (map_.knows(known_epoch)) {
    for (const wire::KnownTile& tile : known) revisions[tile.key] = tile.revision;
  }
  for (const auto& [key, tile] : map_.replica().tiles()) {
    const auto found = revisions.find(key);
    const bool is_known = found != revisions.end() && found->second == tile.revision;
    if (delivery.covers(key) && !is_known) delivery.keys.push_back(key);
  }
  delivery.cut = map_.head();
  sort(delivery.keys);
}

/// The map has gone on: what has changed since the cut is sent, again where it was sent already, with what is left.
void Conversation::recut(Session::Delivery& delivery) const {
  std::set<TileKey> keys(delivery.keys.begin(), delivery.keys.end());
  for (const auto& [key, tile] : map_.replica().tiles()) {
    if (delivery.covers(key) && map_.last_seq(key) > delivery.cut.seq) keys.insert(key);
  }
  delivery.keys.assign(keys.begin(), keys.end());
  delivery.cut = map_.head();
  sort(delivery.keys);
}

/// Those that changed last go first: around the vehicle they are about to change again, which costs a client that has
/// them no more than the change.
void Conversation::sort(std::vector<TileKey>& keys) const {
  std::ranges::stable_sort(keys, {}, [this](TileKey key) { return map_.last_seq(key); });
}

void Conversation::overrun(Session& session, double now_s) {
  ++counts_.overruns;
  Session::Delivery& delivery = session.delivery.emplace(Session::Delivery{});
  delivery.area = session.following->area;
  delivery.cut.seq = session.following->seq;
  announce_lost(session, now_s);
}

/// Changes since the cut cannot be sent any more one by one: the tiles that they touched are, whole.
void Conversation::announce_lost(Session& session, double now_s) {
  Session::Delivery& delivery = *session.delivery;
  const std::uint64_t first_lost_seq = delivery.cut.seq + 1;
  recut(delivery);
  reply(session,
        wire::Overrun{delivery.cut.epoch, first_lost_seq, delivery.cut.seq,
                      static_cast<std::uint32_t>(delivery.keys.size()), delivery.cut.T_map_odom},
        now_s);
}

void Conversation::deliver_snapshot(Session& session, double now_s) {
  Session::Delivery& delivery = *session.delivery;
  for (std::size_t bytes = 0; bytes < facts_.batch_bytes && !delivery.keys.empty();) {
    const TileKey key = delivery.keys.back();
    if (map_.last_seq(key) > delivery.cut.seq) {
      // It is not kept as it was, or every slow client would keep a map of its own.
      ++counts_.recuts;
      return announce_lost(session, now_s);
    }
    const SharedFrame frame = map_.tile_frame(key);
    bytes += frame->size();
    session.queue(frame, now_s);
    delivery.keys.pop_back();
  }
  if (!delivery.keys.empty()) return;
  reply(session, wire::SnapshotEnd{delivery.cut.epoch, delivery.cut.seq, delivery.cut.T_map_odom}, now_s);
  session.following->seq = delivery.cut.seq;
  session.delivery.reset();
}

void Conversation::deliver_answer(Session& session, double now_s) {
  Session::Delivery& delivery = *session.delivery;
  if (delivery.cut.seq != map_.head().seq) recut(delivery);
  wire::Tiles part{delivery.cut.epoch, delivery.cut.seq, {}, true};
  for (std::size_t bytes = 0; bytes < facts_.batch_bytes && !delivery.keys.empty(); delivery.keys.pop_back()) {
    part.tiles.push_back(map_.replica().tiles().at(delivery.keys.back()));
    bytes += map_.tile_frame(delivery.keys.back())->size();
  }
  part.more = !delivery.keys.empty();
  reply(session, part, now_s);
  if (!part.more) session.delivery.reset();
}

void Conversation::set_status(wire::Status status) {
  status_frame_ = map_.encoder().encode(status);
  status_ = std::move(status);
}

Conversation::Ending Conversation::take(Session& session, const wire::GetStatus&, double now_s) {
  if (status_frame_) {
    session.queue(status_frame_, now_s);
  } else {
    refuse(session, wire::Error::Code::unavailable, "no status yet", now_s);
  }
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const wire::GetMetrics&, double now_s) {
  if (status_frame_) {
    reply(session, wire::Metrics{open_metrics_of(status_)}, now_s);
  } else {
    refuse(session, wire::Error::Code::unavailable, "no status yet", now_s);
  }
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const wire::Ping& ping, double now_s) {
  reply(session, wire::Pong{ping.nonce}, now_s);
  return std::nullopt;
}

Conversation::Ending Conversation::take(Session& session, const wire::Command& command, double now_s) {
  using enum wire::Error::Code;
  using Awaited = Session::Awaited;
  const int count = (command.save ? 1 : 0) + (command.new_map ? 1 : 0) + (command.import_map ? 1 : 0);
  if (!session.is_owner) {
    refuse(session, not_authorised, "commands are taken on the control socket only", now_s);
  } else if (count != 1) {
    refuse(session, count == 0 ? unsupported : invalid, "one command at a time, of those that this server knows",
           now_s);
  } else if (command.save && facts_.commands.durable_seq) {
    session.awaited = Awaited{Awaited::What::saved, map_.head().seq};
  } else if (command.new_map && facts_.commands.begin_new_map) {
    facts_.commands.begin_new_map();
    session.awaited = Awaited{Awaited::What::new_map, map_.head().seq};
  } else {
    refuse(session, unsupported, "this daemon cannot carry out this command", now_s);
  }
  return std::nullopt;
}

void Conversation::finish_command(Session& session, double now_s) {
  if (!session.awaited) return;
  const auto [what, seq] = *session.awaited;
  const bool saves = what == Session::Awaited::What::saved;
  const std::uint64_t durable_seq = facts_.commands.durable_seq ? facts_.commands.durable_seq() : 0;
  const bool done = saves ? durable_seq >= seq : map_.replaced_seq() > seq;
  const std::string hindrance = saves && !done && facts_.commands.cannot_save ? facts_.commands.cannot_save() : "";
  if (!done && hindrance.empty()) return;
  session.awaited.reset();
  session.frame_taken(now_s);  // meanwhile we did not read
  const std::string text = !done ? hindrance : saves ? "on disk" : "a new map has begun";
  reply(session, wire::CommandResult{done, text, durable_seq}, now_s);
}

Conversation::Ending Conversation::take(Session& session, const auto&, double now_s) {
  refuse(session, wire::Error::Code::unsupported, "this server does not answer this request", now_s);
  return std::nullopt;
}

bool Conversation::caught_up(const Session& session) const {
  return !session.delivery && (!session.following || session.following->seq == map_.head().seq);
}

bool Conversation::follow(Session& session, double now_s, bool hurry) {
  if (caught_up(session) || !map_.replica().consistent()) return false;
  if (session.delivery) {
    session.delivery->answers ? deliver_answer(session, now_s) : deliver_snapshot(session, now_s);
    return true;
  }
  Session::Following& following = *session.following;
  if (!hurry && now_s < following.next_changes_s) return false;
  for (std::size_t bytes = 0; bytes < facts_.batch_bytes && !caught_up(session);) {
    const SharedFrame change = map_.change(following.seq + 1);
    if (!change) {
      overrun(session, now_s);
      return true;
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
