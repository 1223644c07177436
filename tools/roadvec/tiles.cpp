#include <cinttypes>
#include <cstdio>
#include <map>
#include <set>

#include "tools/roadvec/commands.h"
#include "tools/roadvec/json.h"

namespace roadvec {
namespace {

void print_row(const Tile& tile) {
  std::set<LineId> lines;
  std::size_t vertex_count = 0;
  for (const TilePiece& piece : tile.pieces) {
    lines.insert(piece.line);
    vertex_count += piece.vertices.size();
  }
  std::printf("%6d %6d %10.0f %10.0f %9u %6zu %9zu\n", tile.key.ix, tile.key.iy, tile.key.ix * m_from_mm(kTileSize_mm),
              tile.key.iy * m_from_mm(kTileSize_mm), tile.revision, lines.size(), vertex_count);
}

}  // namespace

int list_tiles(const Connection& connection, const TileChoice& choice) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  wire::GetTiles request;
  request.area = choice.area;
  request.around_vehicle_m = choice.around_vehicle_m;
  if (auto sent = client->send(request); !sent) return complain(sent.error(), kExitFailure);
  // What changes while the answer is under way comes again.
  std::map<TileKey, Tile> tiles;
  for (bool more = true; more;) {
    Expected<wire::Tiles> part = client->receive_one<wire::Tiles>(MapClient::Seconds(connection.timeout_s));
    if (!part) return complain(part.error(), kExitFailure);
    for (Tile& tile : part->tiles) tiles[tile.key] = std::move(tile);
    more = part->more;
  }
  if (!connection.json)
    std::printf("%6s %6s %10s %10s %9s %6s %9s\n", "ix", "iy", "x (m)", "y (m)", "revision", "lines", "vertices");
  for (const auto& [key, tile] : tiles) {
    if (connection.json) {
      std::printf("%s\n", json_of(tile).c_str());
    } else {
      print_row(tile);
    }
  }
  return kExitOk;
}

}  // namespace roadvec
