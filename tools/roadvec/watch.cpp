#include <cinttypes>
#include <cstdio>

#include "core/wire/map_replica.h"
#include "daemon/server/map_files.h"
#include "tools/roadvec/commands.h"
#include "tools/roadvec/json.h"

namespace roadvec {
namespace {

void print_line(const wire::Delta& delta) {
  std::size_t upserted_count = 0, removed_count = 0;
  for (const TileDelta& tile : delta.tiles) {
    upserted_count += tile.upserted.size();
    removed_count += tile.removed.size();
  }
  std::printf("change %" PRIu64 ": %zu tiles, %zu pieces written, %zu removed%s\n", delta.seq, delta.tiles.size(),
              upserted_count, removed_count, delta.continued ? ", to be continued" : "");
}
void print_line(const wire::EpochChange& change) {
  const Pose2 jump = change.T_map_odom_after * change.T_map_odom_before.inverse();
  std::printf("change %" PRIu64 ": epoch %016" PRIx64 ", the map moves by (%.3f, %.3f) m, %.3f deg\n", change.seq,
              change.epoch, jump.x_m, jump.y_m, deg_from_rad(jump.theta_rad));
}
void print_line(const wire::Pose& pose) {
  std::printf("pose %.3f, %.3f m, %.2f deg, %.2f m/s\n", pose.T_map_vehicle.x_m, pose.T_map_vehicle.y_m,
              deg_from_rad(pose.T_map_vehicle.theta_rad), pose.speed_mps);
}
void print_line(const wire::Status& status) {
  std::printf("status %s %s: %.1f m of map, %" PRIu64 " keyframes\n", status.state.c_str(),
              status.not_growing_reason.c_str(), status.map_length_m, status.keyframe_count);
}

/// One subscription: prints what comes and keeps a copy of the map to tell its size, and to notice a gap.
class Watcher {
 public:
  explicit Watcher(bool json) : json_(json) {}

  /// False: the map's changes have a gap.
  bool show(const wire::Message& message) {
    const bool in_order = replica_.apply(message) != wire::MapReplica::Outcome::out_of_order;
    std::visit([&](const auto& m) { show_one(m); }, message);
    std::fflush(stdout);
    return in_order;
  }
  [[nodiscard]] std::uint64_t shown_count() const { return shown_count_; }

 private:
  template <class M>
  void print_message(const M& m) {
    ++shown_count_;
    if (json_) {
      std::printf("%s\n", json_of(m).c_str());
    } else {
      print_line(m);
    }
  }
  void show_one(const wire::Delta& delta) { print_message(delta); }
  void show_one(const wire::EpochChange& change) { print_message(change); }
  void show_one(const wire::Pose& pose) { print_message(pose); }
  void show_one(const wire::Status& status) { print_message(status); }
  void show_one(const wire::SnapshotEnd& end) {
    const VectorMap map = replica_.lines();
    const char* format = json_ ? "{\"type\":\"snapshot\",\"as_of_seq\":%" PRIu64
                                 ",\"tile_count\":%zu,\"line_count\":%zu,\"length_m\":%.1f}\n"
                               : "map as of change %" PRIu64 ": %zu tiles, %zu whole lines, %.1f m\n";
    std::printf(format, end.as_of_seq, replica_.tiles().size(), map.size(), length_m(map));
  }
  void show_one(const wire::Overrun& overrun) {
    const char* format = json_ ? "{\"type\":\"overrun\",\"first_lost_seq\":%" PRIu64 ",\"last_lost_seq\":%" PRIu64 "}\n"
                               : "too slow: changes %" PRIu64 " to %" PRIu64
                                 " are lost, the tiles they touched follow\n";
    std::printf(format, overrun.first_lost_seq, overrun.last_lost_seq);
  }
  void show_one(const auto&) {}

  bool json_;
  wire::MapReplica replica_;
  std::uint64_t shown_count_ = 0;
};

}  // namespace

int watch(const Connection& connection, const WatchChoice& choice) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  wire::Subscribe subscribe;
  subscribe.area = choice.area;
  subscribe.poses = choice.poses;
  subscribe.status = choice.status;
  subscribe.max_rate_hz = choice.max_rate_hz;
  if (auto sent = client->send(subscribe); !sent) return complain(sent.error(), kExitFailure);
  Watcher watcher(connection.json);
  while (choice.message_count == 0 || watcher.shown_count() < choice.message_count) {
    const Expected<wire::Message> message = client->receive(MapClient::Seconds(connection.timeout_s));
    if (!message) return complain(message.error(), kExitFailure);
    if (const auto* error = std::get_if<wire::Error>(&*message)) return complain({error->text}, kExitFailure);
    if (const auto* bye = std::get_if<wire::Bye>(&*message)) {
      if (bye->reason == wire::Bye::Reason::shutdown) return kExitOk;
      return complain({"the daemon closed the connection: " + bye->text}, kExitFailure);
    }
    if (!watcher.show(*message)) return complain({"a change of the map is missing"}, kExitFailure);
  }
  return kExitOk;
}

}  // namespace roadvec
