#include "core/wire/map_replica.h"

#include <algorithm>

namespace roadvec::wire {

bool Area::touches(TileKey key) const {
  const std::int64_t x_mm = std::int64_t{key.ix} * kTileSize_mm, y_mm = std::int64_t{key.iy} * kTileSize_mm;
  return x_mm <= x_max_mm && x_mm + kTileSize_mm > x_min_mm && y_mm <= y_max_mm && y_mm + kTileSize_mm > y_min_mm;
}

void apply(const TileDelta& delta, Tile& tile) {
  const auto replaced = [&](const TilePiece& piece) {
    return std::ranges::find(delta.removed, piece.line) != delta.removed.end() ||
           std::ranges::find(delta.upserted, piece.line, &TilePiece::line) != delta.upserted.end();
  };
  std::erase_if(tile.pieces, replaced);
  tile.pieces.insert(tile.pieces.end(), delta.upserted.begin(), delta.upserted.end());
  std::ranges::stable_sort(tile.pieces, [](const TilePiece& a, const TilePiece& b) {
    return std::pair(a.line, a.first_vertex) < std::pair(b.line, b.first_vertex);
  });
  tile.key = delta.key;
  tile.revision = delta.revision;
}

MapReplica MapReplica::empty_at(std::uint64_t epoch, std::uint64_t seq, const Pose2& T_map_odom) {
  MapReplica replica;
  replica.phase_ = Phase::following;
  replica.epoch_ = epoch;
  replica.seq_ = seq;
  replica.T_map_odom_ = T_map_odom;
  return replica;
}

std::optional<Resume> MapReplica::resume() const {
  if (phase_ != Phase::following) return std::nullopt;
  return Resume{epoch_, seq_};
}

std::vector<KnownTile> MapReplica::known() const {
  std::vector<KnownTile> known;
  for (const auto& [key, tile] : tiles_) known.push_back({key, tile.revision});
  return known;
}

MapReplica::Outcome MapReplica::apply(const Message& message) {
  return std::visit([&](const auto& m) { return take(m); }, message);
}

MapReplica::Outcome MapReplica::take(const SnapshotBegin& begin) {
  if (!begin.incremental) tiles_.clear();
  phase_ = Phase::receiving_tiles;
  continued_ = false;
  epoch_ = begin.epoch;
  seq_ = begin.as_of_seq;
  T_map_odom_ = begin.T_map_odom;
  return Outcome::applied;
}

MapReplica::Outcome MapReplica::take(const Tile& tile) {
  if (phase_ != Phase::receiving_tiles) return Outcome::out_of_order;
  tiles_[tile.key] = tile;
  return Outcome::applied;
}

MapReplica::Outcome MapReplica::take(const SnapshotEnd& end) {
  if (phase_ != Phase::receiving_tiles) return Outcome::out_of_order;
  phase_ = Phase::following;
  epoch_ = end.epoch;
  seq_ = end.as_of_seq;
  T_map_odom_ = end.T_map_odom;
  return Outcome::applied;
}

MapReplica::Outcome MapReplica::take(const Resumed& resumed) {
  if (phase_ != Phase::following || resumed.from_seq != seq_ + 1) return Outcome::out_of_order;
  return Outcome::applied;
}

MapReplica::Outcome MapReplica::take(const Overrun& overrun) {
  if (phase_ == Phase::nothing && seq_ == 0) return Outcome::out_of_order;
  phase_ = Phase::receiving_tiles;
  continued_ = false;
  epoch_ = overrun.epoch;
  if (overrun.T_map_odom) T_map_odom_ = *overrun.T_map_odom;
  return Outcome::applied;
}

MapReplica::Outcome MapReplica::take(const Delta& delta) {
  if (phase_ != Phase::following || delta.seq != seq_ + 1 || delta.epoch != epoch_) return Outcome::out_of_order;
  for (const TileDelta& tile : delta.tiles) wire::apply(tile, tiles_[tile.key]);
  seq_ = delta.seq;
  continued_ = delta.continued;
  T_map_odom_ = delta.T_map_odom;
  return Outcome::applied;
}

MapReplica::Outcome MapReplica::take(const EpochChange& change) {
  if (phase_ != Phase::following || change.seq != seq_ + 1 || change.epoch_before != epoch_)
    return Outcome::out_of_order;
  seq_ = change.seq;
  epoch_ = change.epoch;
  T_map_odom_ = change.T_map_odom_after;
  return Outcome::applied;
}

VectorMap MapReplica::lines() const {
  std::map<LineId, std::vector<const TilePiece*>> pieces;
  for (const auto& [key, tile] : tiles_) {
    for (const TilePiece& piece : tile.pieces) pieces[piece.line].push_back(&piece);
  }
  VectorMap map;
  for (const auto& [id, of_line] : pieces) {
    MapLine line;
    if (stitch(of_line, line)) map.emplace(id, std::move(line));
  }
  return map;
}

}  // namespace roadvec::wire
