#pragma once

#include <map>

#include "core/wire/messages.h"

namespace roadvec::wire {

/// The receiving side of the map: the messages of a subscription in, tiles and whole lines out. Used by the server for
/// its own copy, by clients and by tests, so that all apply the same rules.
class MapReplica {
 public:
  enum class Outcome {
    unrelated,  ///< not a message that carries the map
    applied,
    out_of_order,  ///< a seq is missing or a message came where it cannot: this copy is no longer the server's map
  };
  /// Takes one message of the server, in the order of arrival.
  Outcome apply(const Message& message);

  /// Tiles and lines are those of the server at seq(): not in the middle of a snapshot or of a change in several
  /// frames.
  [[nodiscard]] bool consistent() const { return phase_ == Phase::following && !continued_; }
  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
  [[nodiscard]] std::uint64_t seq() const { return seq_; }
  [[nodiscard]] const Pose2& T_map_odom() const { return T_map_odom_; }
  [[nodiscard]] const std::map<TileKey, Tile>& tiles() const { return tiles_; }
  /// What to ask for after a broken connection, with the same area. None: it broke between SnapshotBegin or Overrun and
  /// SnapshotEnd, so this copy is the map of no seq; ask for a snapshot without the tiles that known() names.
  [[nodiscard]] std::optional<Resume> resume() const;
  [[nodiscard]] std::vector<KnownTile> known() const;
  /// Whole lines, by id. A line of which vertices are missing, because they lie outside the subscribed area, is left
  /// out.
  [[nodiscard]] VectorMap lines() const;

  /// An empty map that follows from seq + 1 on: how the server's own copy begins.
  [[nodiscard]] static MapReplica empty_at(std::uint64_t epoch, std::uint64_t seq, const Pose2& T_map_odom = {});

 private:
  enum class Phase { nothing, receiving_tiles, following };

  Outcome take(const SnapshotBegin& begin);
  Outcome take(const Tile& tile);
  Outcome take(const SnapshotEnd& end);
  Outcome take(const Resumed& resumed);
  Outcome take(const Overrun& overrun);
  Outcome take(const Delta& delta);
  Outcome take(const EpochChange& change);
  Outcome take(const auto&) { return Outcome::unrelated; }

  Phase phase_ = Phase::nothing;
  bool continued_ = false;
  std::uint64_t epoch_ = 0, seq_ = 0;
  Pose2 T_map_odom_;
  std::map<TileKey, Tile> tiles_;
};

/// Applies one tile delta to the tile's content.
void apply(const TileDelta& delta, Tile& tile);

}  // namespace roadvec::wire
