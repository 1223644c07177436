#include "daemon/store/map_copy.h"

#include "core/wire/codec.h"

namespace roadvec {

bool MapCopy::take(std::string_view frame) {
  const Expected<wire::Message> message =
      wire::decode_envelope(frame.substr(wire::kFrameHeaderBytes), wire::Sender::server);
  return message && std::visit([&](const auto& m) { return apply(m); }, *message);
}

bool MapCopy::apply(const wire::Delta& delta) {
  if (delta.seq != newest_.seq + 1 || delta.epoch != newest_.epoch) return false;
  newest_.seq = delta.seq;
  for (const TileDelta& tile : delta.tiles) {
    pieces_.insert(pieces_.end(), tile.upserted.begin(), tile.upserted.end());
    left_.insert(tile.removed.begin(), tile.removed.end());
  }
  return delta.continued || complete();
}

bool MapCopy::apply(const wire::EpochChange& change) {
  if (change.seq != newest_.seq + 1 || change.epoch_before != newest_.epoch) return false;
  newest_ = {change.epoch, change.seq, change.T_map_odom_after};
  begins_anew_ = change.reason == wire::EpochChange::Reason::map_replaced;
  if (!begins_anew_) head_ = newest_;
  return true;
}

void MapCopy::let_go() {
  map_.clear();
  changed_.clear();
  head_ = newest_;
  begins_anew_ = false;
}

bool MapCopy::complete() {
  std::map<LineId, std::vector<const TilePiece*>> pieces_of_line;
  for (const TilePiece& piece : pieces_) pieces_of_line[piece.line].push_back(&piece);
  for (const LineId id : left_) {
    // Out of this tile, yet in others.
    if (pieces_of_line.contains(id)) continue;
    map_.erase(id);
    changed_.insert(id);
  }
  for (const auto& [id, pieces] : pieces_of_line) {
    MapLine line;
    if (!stitch(pieces, line)) return false;
    map_.insert_or_assign(id, std::move(line));
    changed_.insert(id);
  }
  pieces_.clear();
  left_.clear();
  head_ = newest_;
  return true;
}

void MapCopy::all_changed() {
  for (const auto& [id, line] : map_) changed_.insert(id);
}

}  // namespace roadvec
