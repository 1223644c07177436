#include "core/map/tiles.h"

#include <algorithm>
#include <cmath>

#include "core/base/ensure.h"

namespace roadvec {
namespace {

struct Point_mm {
  std::int64_t x = 0, y = 0;
};

std::int64_t cross(Point_mm a, Point_mm b) { return a.x * b.y - a.y * b.x; }

/// The closed square of a tile and the closed segment share a point; the segment's bounding box is known to reach the
/// tile, so only the segment's own normal is left as a separating axis. Exact: |coordinates| <= 1e9, so products stay
/// below 2^63.
bool touches(TileKey key, Point_mm a, Point_mm b) {
  const Point_mm corner{std::int64_t{key.ix} * kTileSize_mm, std::int64_t{key.iy} * kTileSize_mm};
  const Point_mm along{b.x - a.x, b.y - a.y};
  int left_count = 0, right_count = 0;
  for (const Point_mm offset : {Point_mm{0, 0}, {kTileSize_mm, 0}, {0, kTileSize_mm}, {kTileSize_mm, kTileSize_mm}}) {
    const std::int64_t side = cross(along, {corner.x + offset.x - a.x, corner.y + offset.y - a.y});
    left_count += side > 0 ? 1 : 0;
    right_count += side < 0 ? 1 : 0;
  }
  return left_count < 4 && right_count < 4;
}

/// Calls f(key) for every tile that the segment from a to b touches.
template <class F>
void for_each_tile(const TileVertex& a, const TileVertex& b, F&& f) {
  const TileKey low = tile_of(std::min(a.x_mm, b.x_mm), std::min(a.y_mm, b.y_mm));
  const TileKey high = tile_of(std::max(a.x_mm, b.x_mm), std::max(a.y_mm, b.y_mm));
  for (std::int32_t ix = low.ix; ix <= high.ix; ++ix) {
    for (std::int32_t iy = low.iy; iy <= high.iy; ++iy) {
      if (touches({ix, iy}, {a.x_mm, a.y_mm}, {b.x_mm, b.y_mm})) f(TileKey{ix, iy});
    }
  }
}

std::vector<TileVertex> in_mm(const std::vector<Vertex>& vertices) {
  std::vector<TileVertex> result;
  result.reserve(vertices.size());
  for (const Vertex& v : vertices) {
    result.push_back({mm_from_m(v.x_m), mm_from_m(v.y_m), mm_from_m(v.z_m), mm_from_m(v.height_m),
                      mm_from_m(v.sigma_across_m), mm_from_m(v.sigma_along_m)});
  }
  return result;
}

/// The piece without vertices that all pieces of the line start from.
TilePiece piece_without_vertices(const MapLine& line) {
  TilePiece piece;
  piece.line = line.id;
  piece.revision = line.revision;
  piece.attributes = line.attributes;
  piece.first_seen = line.first_seen;
  piece.last_seen = line.last_seen;
  piece.line_vertex_count = static_cast<std::uint32_t>(line.vertices.size());
  LineAttributes& attributes = piece.attributes;
  attributes.height_m = static_cast<float>(m_from_mm(std::max(mm_from_m(attributes.height_m), 0)));
  attributes.existence = static_cast<float>(m_from_mm(std::clamp(mm_from_m(attributes.existence), 0, 1000)));
  return piece;
}

}  // namespace

TileKey tile_of(std::int32_t x_mm, std::int32_t y_mm) {
  const auto floor_of = [](std::int32_t mm) { return mm / kTileSize_mm - (mm % kTileSize_mm < 0 ? 1 : 0); };
  return {floor_of(x_mm), floor_of(y_mm)};
}

std::int32_t mm_from_m(double m) {
  if (std::isnan(m)) return kFarthest_mm;
  return static_cast<std::int32_t>(std::lround(std::clamp(m * 1000.0, -1.0 * kFarthest_mm, 1.0 * kFarthest_mm)));
}

std::map<TileKey, std::vector<TilePiece>> pieces_of(const MapLine& line) {
  const std::vector<TileVertex> vertices = in_mm(line.vertices);
  const TilePiece empty = piece_without_vertices(line);
  std::map<TileKey, std::vector<TilePiece>> tiles;
  if (vertices.size() == 1) {
    TilePiece& piece = tiles[tile_of(vertices[0].x_mm, vertices[0].y_mm)].emplace_back(empty);
    piece.vertices = vertices;
  }
  for (std::uint32_t i = 0; i + 1 < vertices.size(); ++i) {
    for_each_tile(vertices[i], vertices[i + 1], [&](TileKey key) {
      std::vector<TilePiece>& pieces = tiles[key];
      const bool goes_on = !pieces.empty() && pieces.back().first_vertex + pieces.back().vertices.size() == i + 1;
      if (!goes_on) {
        pieces.push_back(empty);
        pieces.back().first_vertex = i;
        pieces.back().vertices.push_back(vertices[i]);
      }
      pieces.back().vertices.push_back(vertices[i + 1]);
    });
  }
  return tiles;
}

bool stitch(const std::vector<const TilePiece*>& pieces, MapLine& line) {
  if (pieces.empty()) return false;
  const TilePiece& first = *pieces.front();
  line = MapLine{first.line, first.revision, first.attributes, first.first_seen, first.last_seen, {}};
  // Sorted by first vertex, pieces must reach from one to the next; so memory is bounded by what the pieces really
  // hold.
  std::vector<const TilePiece*> sorted = pieces;
  std::ranges::stable_sort(sorted, {}, &TilePiece::first_vertex);
  for (const TilePiece* piece : sorted) {
    if (piece->revision != first.revision || piece->line_vertex_count != first.line_vertex_count) return false;
    if (piece->first_vertex > line.vertices.size()) return false;
    for (std::size_t i = line.vertices.size() - piece->first_vertex; i < piece->vertices.size(); ++i) {
      const TileVertex& v = piece->vertices[i];
      const auto metres = [](std::int32_t mm) { return static_cast<float>(m_from_mm(mm)); };
      line.vertices.push_back({m_from_mm(v.x_mm), m_from_mm(v.y_mm), metres(v.z_mm), metres(v.height_mm),
                               metres(v.sigma_across_mm), metres(v.sigma_along_mm)});
    }
  }
  return line.vertices.size() == first.line_vertex_count;
}

std::vector<TileDelta> TileTable::apply(const MapChange& change, const VectorMap& map) {
  std::map<TileKey, TileDelta> deltas;
  for (const LineId id : change.upserted) {
    const auto line = map.find(id);
    ENSURE(line != map.end());
    std::vector<TileKey> keys;
    for (auto& [key, pieces] : pieces_of(line->second)) {
      keys.push_back(key);
      std::ranges::move(pieces, std::back_inserter(deltas[key].upserted));
    }
    for (const TileKey key : tiles_of_line_[id]) {
      if (!std::ranges::binary_search(keys, key)) deltas[key].removed.push_back(id);
    }
    tiles_of_line_[id] = std::move(keys);
  }
  for (const LineId id : change.removed) {
    const auto known = tiles_of_line_.find(id);
    if (known == tiles_of_line_.end()) continue;
    for (const TileKey key : known->second) deltas[key].removed.push_back(id);
    tiles_of_line_.erase(known);
  }
  std::vector<TileDelta> result;
  for (auto& [key, delta] : deltas) {
    delta.key = key;
    delta.revision = ++revisions_[key];
    std::ranges::sort(delta.removed);
    result.push_back(std::move(delta));
  }
  return result;
}

}  // namespace roadvec
