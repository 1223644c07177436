#pragma once

#include <GeographicLib/LocalCartesian.hpp>
#include <vector>

#include "core/geometry/anchor.h"
#include "core/map/vector_map.h"

namespace roadvec {

/// A position on or above the WGS 84 ellipsoid, in the order of GeoJSON and GeoPackage: longitude first.
struct GeoPosition {
  double longitude_deg = 0, latitude_deg = 0, height_m = 0;
  friend bool operator==(const GeoPosition&, const GeoPosition&) = default;
};

/// As clients receive it: in whole millimetres. What has been over the wire and what has not is then the same.
[[nodiscard]] double published_m(double value_m);

[[nodiscard]] GeographicLib::LocalCartesian enu_at(const Anchor& anchor);
[[nodiscard]] GeoPosition geo_position(const Vertex& vertex, const GeographicLib::LocalCartesian& enu);
[[nodiscard]] std::vector<GeoPosition> geo_positions(const MapLine& line, const GeographicLib::LocalCartesian& enu);

/// Root of the mean square of one of the vertices' sigmas; 0 of a line without any.
[[nodiscard]] double rms_m(const MapLine& line, float Vertex::*sigma_m);

}  // namespace roadvec
