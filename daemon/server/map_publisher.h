#pragma once

#include <vector>

#include "core/map/tiles.h"
#include "core/wire/messages.h"
#include "daemon/server/frame_log.h"

namespace roadvec {

/// How far the published map has come: the newest change, the epoch it belongs to, and the correction of the odometry
/// then in force.
struct MapHead {
  constexpr MapHead() = default;
  constexpr MapHead(std::uint64_t in_epoch, std::uint64_t newest_seq, const Pose2& correction = {})
      : epoch(in_epoch), seq(newest_seq), T_map_odom(correction) {}
  std::uint64_t epoch = 0, seq = 0;
  Pose2 T_map_odom;
};

/// Optimiser thread: changes of the map -> encoded Delta and EpochChange frames in the log. The same changes give the
/// same bytes.
class MapPublisher {
 public:
  /// `start` is the head before the first change; the MapServer of the same log gets the same. For a map that goes on
  /// after a restart, publish all its lines first, as one change. A frame is closed when it holds `full_frame_bytes`:
  /// small enough to share a log of a few MiB with many others.
  MapPublisher(FrameLog& log, MapHead start, std::size_t full_frame_bytes = std::size_t{256} << 10);

  /// `map` is the map after the change. A closed loop is announced by an EpochChange (with the next epoch) before the
  /// lines move. A change too big for one frame takes several. `wait(bytes)` is called before each append: wait there
  /// while !log.has_room(bytes) if nothing may be lost.
  template <class Wait>
  void publish(const MapChange& change, const VectorMap& map, Wait&& wait) {
    for (const wire::Message& message : messages_for(change, map)) {
      const std::string_view frame = encode(message);
      wait(frame.size());
      log_.append(frame);
    }
  }
  [[nodiscard]] MapHead head() const { return head_; }

 private:
  [[nodiscard]] std::vector<wire::Message> messages_for(const MapChange& change, const VectorMap& map);
  [[nodiscard]] std::string_view encode(const wire::Message& message);
  wire::Delta next_delta(const MapChange& change);

  FrameLog& log_;
  std::size_t full_frame_bytes_;
  MapHead head_;
  TileTable tiles_;
  std::vector<char> buffer_;
};

}  // namespace roadvec
