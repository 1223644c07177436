#include "daemon/server/geo_line.h"

#include <cmath>

#include "core/map/tiles.h"

namespace roadvec {

double published_m(double value_m) { return m_from_mm(mm_from_m(value_m)); }

GeographicLib::LocalCartesian enu_at(const Anchor& anchor) {
  return {anchor.latitude_deg, anchor.longitude_deg, anchor.height_m};
}

GeoPosition geo_position(const Vertex& vertex, const GeographicLib::LocalCartesian& enu) {
  GeoPosition p;
  enu.Reverse(published_m(vertex.x_m), published_m(vertex.y_m), published_m(vertex.z_m), p.latitude_deg,
              p.longitude_deg, p.height_m);
  return p;
}

std::vector<GeoPosition> geo_positions(const MapLine& line, const GeographicLib::LocalCartesian& enu) {
  std::vector<GeoPosition> positions;
  positions.reserve(line.vertices.size());
  for (const Vertex& vertex : line.vertices) positions.push_back(geo_position(vertex, enu));
  return positions;
}

double rms_m(const MapLine& line, float Vertex::*sigma_m) {
  double sum_m2 = 0;
  for (const Vertex& vertex : line.vertices) {
    const double published = published_m(vertex.*sigma_m);
    sum_m2 += published * published;
  }
  return line.vertices.empty() ? 0 : std::sqrt(sum_m2 / static_cast<double>(line.vertices.size()));
}

}  // namespace roadvec
