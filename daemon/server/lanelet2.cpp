#include <cstdint>

#include "daemon/server/geo_line.h"
#include "daemon/server/map_files.h"
#include "daemon/server/text_writer.h"

namespace roadvec {
namespace {

constexpr double kLeastDistance_m = 0.05;  // lanelet2_validation warns of points nearer than this
constexpr double kHighCurb_m = 0.10;       // choice: a car's bumper and wheels get over less

std::string tag(std::string_view key, std::string_view value) {
  return "<tag k=\"" + std::string(key) + "\" v=\"" + std::string(value) + "\"/>";
}

/// [Lanelet2, LinestringTagging]: a road_border ends what can be driven on; behind a curbstone it goes on. Wall, fence
/// and guard_rail are not told apart, so a barrier is a road_border with its height.
std::string tags_of(const LineAttributes& attributes) {
  const double height_m = published_m(attributes.height_m);
  const std::string height = tag("height", decimal(height_m, 3));
  if (attributes.kind != BoundaryKind::curb) return tag("type", "road_border") + height;
  return tag("type", "curbstone") + tag("subtype", height_m < kHighCurb_m ? "low" : "high") + height;
}

bool near(const Vertex& a, const Vertex& b) { return (a.position() - b.position()).norm() < kLeastDistance_m; }

/// The vertices to write: the ends, and between them none that is too near to the next; none of a line that is no more
/// than a dot.
std::vector<Vertex> spaced(const std::vector<Vertex>& vertices) {
  std::vector<Vertex> kept;
  for (const Vertex& v : vertices) {
    if (kept.empty() || !near(kept.back(), v)) kept.push_back(v);
  }
  if (kept.empty()) return kept;
  const Vertex& last = vertices.back();
  if (kept.back() == last) kept.pop_back();
  while (kept.size() > 1 && near(kept.back(), last)) kept.pop_back();
  if (kept.empty() || near(kept.back(), last)) return {};
  kept.push_back(last);
  return kept;
}

}  // namespace

std::string lanelet2_of(const VectorMap& map, const Anchor& anchor) {
  const GeographicLib::LocalCartesian enu = enu_at(anchor);
  std::string nodes, ways;
  std::int64_t node = 0, way = 0;
  for (const auto& [id, line] : map) {
    // Parked vehicles are no border of the road.
    if (line.attributes.kind == BoundaryKind::vehicle_row) continue;
    const std::vector<Vertex> vertices = spaced(line.vertices);
    if (vertices.empty()) continue;
    ways += "<way id=\"" + std::to_string(++way) + "\" version=\"1\" visible=\"true\">";
    for (const Vertex& v : vertices) {
      const GeoPosition p = geo_position(v, enu);
      const std::string number = std::to_string(++node);
      nodes += "<node id=\"" + number + "\" version=\"1\" visible=\"true\" lat=\"" + decimal(p.latitude_deg, 9) +
               "\" lon=\"" + decimal(p.longitude_deg, 9) + "\">" + tag("ele", decimal(p.height_m, 4)) + "</node>\n";
      ways += "<nd ref=\"" + number + "\"/>";
    }
    ways += tags_of(line.attributes) + "</way>\n";
  }
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- projector_type: LocalCartesian, map_origin: latitude " +
         decimal(anchor.latitude_deg, 10) + ", longitude " + decimal(anchor.longitude_deg, 10) + ", elevation " +
         decimal(anchor.height_m, 4) + " -->\n<osm version=\"0.6\" generator=\"roadvec\">\n" + nodes + ways +
         "</osm>\n";
}

}  // namespace roadvec
