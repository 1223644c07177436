#include "daemon/server/map_publisher.h"

#include "core/base/ensure.h"
#include "core/wire/codec.h"

namespace roadvec {
namespace {

/// Upper limit of what a tile delta takes on the wire: six numbers of at most five bytes per vertex.
std::size_t most_bytes(const TileDelta& delta) {
  std::size_t bytes = 32 + 10 * delta.removed.size();
  for (const TilePiece& piece : delta.upserted) bytes += 128 + 30 * piece.vertices.size();
  return bytes;
}

}  // namespace

MapPublisher::MapPublisher(FrameLog& log, MapHead start, std::size_t full_frame_bytes)
    : log_(log),
      full_frame_bytes_(full_frame_bytes),
      head_(start),
      buffer_(wire::kMostServerBytes + wire::kFrameHeaderBytes) {}

wire::Delta MapPublisher::next_delta(const MapChange& change) {
  wire::Delta delta;
  delta.epoch = head_.epoch;
  delta.seq = ++head_.seq;
  delta.time = change.time;
  delta.T_map_odom = change.T_map_odom;
  return delta;
}

std::vector<wire::Message> MapPublisher::messages_for(const MapChange& change, const VectorMap& map) {
  std::vector<wire::Message> messages;
  if (change.closed_loop || change.begins_anew) {
    using enum wire::EpochChange::Reason;
    const std::uint64_t before = head_.epoch++;
    messages.push_back(wire::EpochChange{change.begins_anew ? map_replaced : loop_closure, before, head_.epoch,
                                         ++head_.seq, change.time, head_.T_map_odom, change.T_map_odom});
  }
  head_.T_map_odom = change.T_map_odom;
  std::vector<TileDelta> tiles = tiles_.apply(change, map);
  if (tiles.empty() && change.lineage.empty()) return messages;

  wire::Delta delta = next_delta(change);
  delta.lineage = change.lineage;
  std::size_t bytes = 0;
  for (TileDelta& tile : tiles) {
    const std::size_t more_bytes = most_bytes(tile);
    if (!delta.tiles.empty() && bytes + more_bytes > full_frame_bytes_) {
      delta.continued = true;
      messages.push_back(std::move(delta));
      delta = next_delta(change);
      bytes = 0;
    }
    bytes += more_bytes;
    delta.tiles.push_back(std::move(tile));
  }
  messages.push_back(std::move(delta));
  return messages;
}

std::string_view MapPublisher::encode(const wire::Message& message) {
  std::string_view frame;
  if (const auto* delta = std::get_if<wire::Delta>(&message)) frame = wire::encode_frame(*delta, buffer_);
  if (const auto* epoch = std::get_if<wire::EpochChange>(&message)) frame = wire::encode_frame(*epoch, buffer_);
  ENSURE(!frame.empty());  // 16 MiB are half a million vertices in one tile
  return frame;
}

}  // namespace roadvec
