#include "daemon/server/served_map.h"

#include <algorithm>

namespace roadvec {

ServedMap::ServedMap(FrameLog& log, MapHead start)
    : log_(log),
      reader_(log),
      replica_(wire::MapReplica::empty_at(start.epoch, start.seq, start.T_map_odom)),
      first_seq_(start.seq + 1),
      epochs_{start} {}

ServedMap::Taken ServedMap::take_new() {
  reader_.clear_doorbell();
  while (true) {
    const FrameLog::Position position = reader_.position();
    switch (reader_.next(frame_)) {
      case FrameLog::Outcome::nothing_new:
        forget_overwritten();
        return Taken::all;
      case FrameLog::Outcome::overrun:
        return Taken::lost;
      case FrameLog::Outcome::frame:
        if (!take(frame_, position)) return Taken::lost;
    }
  }
}

bool ServedMap::take(const std::string& frame, FrameLog::Position position) {
  const std::string_view envelope = std::string_view(frame).substr(wire::kFrameHeaderBytes);
  const Expected<wire::Message> message = wire::decode_envelope(envelope, wire::Sender::server);
  if (!message || replica_.apply(*message) != wire::MapReplica::Outcome::applied) return false;
  if (const auto* delta = std::get_if<wire::Delta>(&*message)) {
    for (const TileDelta& tile : delta->tiles) {
      last_seq_[tile.key] = delta->seq;
      tile_frames_.erase(tile.key);
    }
  }
  if (const auto* change = std::get_if<wire::EpochChange>(&*message)) {
    epochs_.push_back({change->epoch, change->seq, change->T_map_odom_after});
    if (change->reason == wire::EpochChange::Reason::map_replaced) replaced_seq_ = change->seq;
  }
  positions_.push_back(position);
  return true;
}

SharedFrame ServedMap::change(std::uint64_t seq) {
  if (seq < first_seq_ || seq - first_seq_ >= positions_.size()) return nullptr;
  if (change_ && change_seq_ == seq) return change_;
  FrameLog::Position position = positions_[seq - first_seq_];
  if (log_.read(position, frame_) != FrameLog::Outcome::frame) {
    forget_overwritten();
    return nullptr;
  }
  change_seq_ = seq;
  return change_ = std::make_shared<const std::string>(frame_);
}

void ServedMap::forget_overwritten() {
  while (!positions_.empty() && positions_.front() < log_.oldest()) {
    positions_.pop_front();
    ++first_seq_;
  }
}

SharedFrame ServedMap::tile_frame(TileKey key) {
  SharedFrame& frame = tile_frames_[key];
  if (!frame) frame = encoder_.encode(replica_.tiles().at(key));
  return frame;
}

bool ServedMap::knows(std::uint64_t epoch) const {
  return std::ranges::find(epochs_, epoch, &MapHead::epoch) != epochs_.end();
}

bool ServedMap::knows(std::uint64_t epoch, std::uint64_t seq) const {
  const auto later = std::ranges::find_if(epochs_, [&](const MapHead& begin) { return begin.seq > seq; });
  return later != epochs_.begin() && (later - 1)->epoch == epoch && seq <= replica_.seq();
}

}  // namespace roadvec
