#include "daemon/server/geo_line.h"
#include "daemon/server/map_files.h"
#include "daemon/server/text_writer.h"

namespace roadvec {
namespace {

std::string coordinates(const MapLine& line, const GeographicLib::LocalCartesian& enu) {
  std::string text = "[";
  for (const GeoPosition& p : geo_positions(line, enu)) {
    text += text.size() > 1 ? ",[" : "[";
    text += decimal(p.longitude_deg, 9) + "," + decimal(p.latitude_deg, 9) + "," + decimal(p.height_m, 4) + "]";
  }
  return text + "]";
}

std::string feature(const MapLine& line, const GeographicLib::LocalCartesian& enu) {
  const LineAttributes& a = line.attributes;
  std::string text = "{\"type\":\"Feature\",\"id\":" + std::to_string(line.id) + ",\"properties\":{";
  text += "\"id\":" + std::to_string(line.id) + ",\"revision\":" + std::to_string(line.revision);
  text += ",\"kind\":" + json_text(name_of(a.kind)) + ",\"height_m\":" + decimal(a.height_m, 3);
  text += ",\"existence\":" + decimal(a.existence, 3) + ",\"observation_count\":" + std::to_string(a.observation_count);
  text += ",\"first_end\":" + json_text(name_of(a.first_end)) + ",\"last_end\":" + json_text(name_of(a.last_end));
  text +=
      ",\"first_seen_s\":" + seconds_text(line.first_seen.ns) + ",\"last_seen_s\":" + seconds_text(line.last_seen.ns);
  text += ",\"sigma_across_m\":" + decimal(rms_m(line, &Vertex::sigma_across_m), 3);
  text += ",\"sigma_along_m\":" + decimal(rms_m(line, &Vertex::sigma_along_m), 3);
  text += "},\"geometry\":{\"type\":\"LineString\",\"coordinates\":" + coordinates(line, enu) + "}}";
  return text;
}

}  // namespace

double length_m(const VectorMap& map) {
  double length_m = 0;
  for (const auto& [id, line] : map) {
    for (std::size_t i = 1; i < line.vertices.size(); ++i) {
      length_m += (line.vertices[i].position() - line.vertices[i - 1].position()).norm();
    }
  }
  return length_m;
}

std::string geojson_of(const VectorMap& map, const Anchor& anchor) {
  const GeographicLib::LocalCartesian enu = enu_at(anchor);
  std::string text =
      "{\"type\":\"FeatureCollection\",\n\"anchor\":{\"latitude_deg\":" + decimal(anchor.latitude_deg, 10) +
      ",\"longitude_deg\":" + decimal(anchor.longitude_deg, 10) + ",\"height_m\":" + decimal(anchor.height_m, 4) +
      ",\"yaw_deg\":" + decimal(anchor.yaw_deg, 6) + "},\n\"features\":[";
  bool first = true;
  for (const auto& [id, line] : map) {
    // A LineString has at least two positions [RFC 7946, 3.1.4].
    if (line.vertices.size() < 2) continue;
    text += first ? "\n" : ",\n";
    text += feature(line, enu);
    first = false;
  }
  return text + "\n]}\n";
}

}  // namespace roadvec
