#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <vector>

#include "core/map/vector_map.h"

namespace roadvec {

/// The published map is served in squares of the map frame. 64 m: a car that sees 60 m around it touches about nine.
inline constexpr std::int32_t kTileSize_mm = 64'000;
/// No coordinate of a published line is farther than this from the anchor: 1000 km.
inline constexpr std::int32_t kFarthest_mm = 1'000'000'000;

struct TileKey {
  std::int32_t ix = 0, iy = 0;  ///< floor(x / size), floor(y / size)
  friend auto operator<=>(const TileKey&, const TileKey&) = default;
};

/// A vertex in whole millimetres of the map frame: what is published, stored and compared.
struct TileVertex {
  std::int32_t x_mm = 0, y_mm = 0, z_mm = 0;
  std::int32_t height_mm = 0, sigma_across_mm = 0, sigma_along_mm = 0;
  friend bool operator==(const TileVertex&, const TileVertex&) = default;
};

/// A run of consecutive vertices of a line: those of all its segments that touch the tile. End vertices may lie
/// outside: nothing is cut and no vertex invented, so that lines come together again exactly. A line may have several
/// pieces in one tile.
struct TilePiece {
  LineId line = 0;
  std::uint32_t revision = 0;  ///< of the line; all pieces of a line carry the same one
  LineAttributes attributes;   ///< of the line, height in whole millimetres, existence in whole per mille
  SensorTime first_seen, last_seen;
  std::uint32_t first_vertex = 0;  ///< index in the line of vertices.front()
  std::uint32_t line_vertex_count = 0;
  std::vector<TileVertex> vertices;
  friend bool operator==(const TilePiece&, const TilePiece&) = default;
};

struct Tile {
  TileKey key;
  std::uint32_t revision = 0;     ///< grows with every change of the tile
  std::vector<TilePiece> pieces;  ///< ascending by (line, first_vertex); none: the tile became empty
  friend bool operator==(const Tile&, const Tile&) = default;
};

/// What changed in one tile.
struct TileDelta {
  TileKey key;
  std::uint32_t revision = 0;  ///< of the tile after the change
  std::vector<TilePiece>
      upserted;                 ///< all pieces in this tile of each upserted line: they replace what the tile had of it
  std::vector<LineId> removed;  ///< lines that left this tile or the map, ascending
  friend bool operator==(const TileDelta&, const TileDelta&) = default;
};

[[nodiscard]] TileKey tile_of(std::int32_t x_mm, std::int32_t y_mm);
/// Nearest whole millimetre; NaN and what lies beyond kFarthest_mm become the nearest value that can be published.
[[nodiscard]] std::int32_t mm_from_m(double m);
[[nodiscard]] inline double m_from_mm(std::int32_t mm) { return mm / 1000.0; }

/// Both have tiles in ascending order. A line without vertices is in no tile.
[[nodiscard]] std::map<TileKey, std::vector<TilePiece>> pieces_of(const MapLine& line);
/// The pieces of one line put together again; false when vertices are missing or revisions differ (pieces of other
/// tiles needed).
[[nodiscard]] bool stitch(const std::vector<const TilePiece*>& pieces, MapLine& line);

/// Turns changes of the map into changes of tiles. Remembers which tiles each line is in and the revision of each tile,
/// not the lines. Owner: the optimiser thread. The same changes give the same deltas.
class TileTable {
 public:
  /// `map` is the map after `change`. Every line in change.upserted is in it.
  [[nodiscard]] std::vector<TileDelta> apply(const MapChange& change, const VectorMap& map);

 private:
  std::map<LineId, std::vector<TileKey>> tiles_of_line_;
  std::map<TileKey, std::uint32_t> revisions_;
};

}  // namespace roadvec
