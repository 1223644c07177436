#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/server/geo_line.h"

namespace roadvec {

/// Smallest rectangle around positions; empty while min > max.
struct GeoEnvelope {
  double min_longitude_deg = 1e9, max_longitude_deg = -1e9, min_latitude_deg = 1e9, max_latitude_deg = -1e9;
  void add(const GeoPosition& position);
  void add(const GeoEnvelope& other);
};

/// A LineString Z in WGS 84 as the binary of a GeoPackage: header with its envelope, then well-known binary
/// [GeoPackage, 2.1.3].
[[nodiscard]] std::vector<std::uint8_t> geometry_blob(std::span<const GeoPosition> line, const GeoEnvelope& envelope);
/// Reads what geometry_blob() writes, of any envelope type, little-endian. None: it is something else, or cut short.
[[nodiscard]] std::optional<std::vector<GeoPosition>> positions_in(std::span<const std::uint8_t> blob);

}  // namespace roadvec
