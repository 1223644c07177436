#include <vector>

#include "core/map/tiles.h"
#include "core/wire/codec.h"
#include "daemon/server/map_files.h"

namespace roadvec {

std::size_t tile_bytes(const VectorMap& map) {
  MapChange everything;
  for (const auto& [id, line] : map) everything.upserted.push_back(id);
  std::vector<char> buffer(wire::kMostServerBytes + wire::kFrameHeaderBytes);
  TileTable table;
  std::size_t bytes = 0;
  for (TileDelta& tile : table.apply(everything, map)) {
    bytes += wire::encode_frame(Tile{tile.key, tile.revision, std::move(tile.upserted)}, buffer).size();
  }
  return bytes;
}

}  // namespace roadvec
