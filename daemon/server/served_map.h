#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "core/wire/codec.h"
#include "core/wire/map_replica.h"
#include "daemon/server/frame_log.h"
#include "daemon/server/map_publisher.h"

namespace roadvec {

/// An encoded frame on its way to one or many clients; never changed once made. Shared, because most clients are at the
/// same change and the same tiles.
using SharedFrame = std::shared_ptr<const std::string>;

/// Encodes messages for clients; server thread only.
class FrameEncoder {
 public:
  FrameEncoder() : buffer_(wire::kMostServerBytes + wire::kFrameHeaderBytes) {}
  /// Never null; a message too long for a frame becomes an Error frame that says so.
  template <class M>
  [[nodiscard]] SharedFrame encode(const M& message) {
    std::string_view frame = wire::encode_frame(message, buffer_);
    if (frame.empty())
      frame = wire::encode_frame(wire::Error{wire::Error::Code::unavailable, "answer too long for a frame"}, buffer_);
    return std::make_shared<const std::string>(frame);
  }

 private:
  std::vector<char> buffer_;
};

/// The server's own copy of the map, made of the frames it reads, so that nothing has to flow back to the optimiser;
/// and where in the log each change lies. Server thread only.
class ServedMap {
 public:
  ServedMap(FrameLog& log, MapHead start);

  enum class Taken { all, lost };
  /// Reads what is new in the log. lost: the log has overrun us, or a frame does not continue the map.
  [[nodiscard]] Taken take_new();
  [[nodiscard]] const FrameLog::Reader& reader() const { return reader_; }

  [[nodiscard]] const wire::MapReplica& replica() const { return replica_; }
  [[nodiscard]] MapHead head() const { return {replica_.epoch(), replica_.seq(), replica_.T_map_odom()}; }
  [[nodiscard]] std::uint64_t oldest_seq() const { return first_seq_; }  ///< head().seq + 1 when none is held
  /// The frame with this seq, or null when the log no longer has it.
  [[nodiscard]] SharedFrame change(std::uint64_t seq);
  [[nodiscard]] SharedFrame tile_frame(TileKey key);
  /// When another map was begun the last time; 0: never.
  [[nodiscard]] std::uint64_t replaced_seq() const { return replaced_seq_; }
  [[nodiscard]] std::uint64_t last_seq(TileKey key) const { return last_seq_.at(key); }
  /// The epoch is the present one or one of those it came from.
  [[nodiscard]] bool knows(std::uint64_t epoch) const;
  /// The change (epoch, seq) was ours.
  [[nodiscard]] bool knows(std::uint64_t epoch, std::uint64_t seq) const;
  [[nodiscard]] FrameEncoder& encoder() { return encoder_; }

 private:
  [[nodiscard]] bool take(const std::string& frame, FrameLog::Position position);
  void forget_overwritten();

  FrameLog& log_;
  FrameLog::Reader reader_;
  wire::MapReplica replica_;
  std::uint64_t first_seq_;                     ///< of positions_.front()
  std::deque<FrameLog::Position> positions_;    ///< of the changes first_seq_, first_seq_ + 1, ...
  std::map<TileKey, std::uint64_t> last_seq_;   ///< newest change of each tile
  std::map<TileKey, SharedFrame> tile_frames_;  ///< of tiles that were asked for and have not changed since
  std::uint64_t change_seq_ = 0;                ///< of change_
  SharedFrame change_;                          ///< the one asked for last: most clients are at the same
  std::vector<MapHead> epochs_;                 ///< every epoch since start, with the seq from which on it holds
  std::uint64_t replaced_seq_ = 0;
  std::string frame_;
  FrameEncoder encoder_;
};

}  // namespace roadvec
