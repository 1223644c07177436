#include "tools/score/boundaries.h"

#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <string>

namespace roadvec {
namespace {

class LocalFrame {
 public:
  explicit LocalFrame(const Anchor& anchor)
      : projection_(anchor.latitude_deg, anchor.longitude_deg, anchor.height_m), height_m_(anchor.height_m) {}
  [[nodiscard]] Vertex vertex(double latitude_deg, double longitude_deg) const {
    Vertex vertex;
    double up_m = 0;
    projection_.Forward(latitude_deg, longitude_deg, height_m_, vertex.x_m, vertex.y_m, up_m);
    return vertex;
  }

 private:
  GeographicLib::LocalCartesian projection_;
  double height_m_;
};

/// A name that nobody knows is `unknown`.
BoundaryKind kind_from(const std::string& name) {
  const auto at = std::find(kBoundaryKindNames.begin(), kBoundaryKindNames.end(), name);
  if (at == kBoundaryKindNames.end()) return BoundaryKind::unknown;
  return static_cast<BoundaryKind>(at - kBoundaryKindNames.begin());
}

double seen_within_m(const nlohmann::json& properties) {
  const auto at = properties.find("seen_within_m");
  if (at == properties.end()) return 0;
  return at->is_number() ? at->get<double>() : std::numeric_limits<double>::infinity();
}

enum class Origin : std::uint8_t { map, truth };

bool is_optional(const nlohmann::json& properties, Origin origin) {
  if (origin == Origin::map) return false;
  return properties.value("removed", false) || properties.value("height_m", kLeastHeight_m) < kLeastHeight_m;
}

void add_feature(const nlohmann::json& feature, const LocalFrame& frame, Origin origin, Boundaries& boundaries) {
  const nlohmann::json& geometry = feature.at("geometry");
  if (geometry.at("type") != "LineString") return;
  const nlohmann::json& properties = feature.at("properties");
  const bool optional = is_optional(properties, origin);
  LineSet& lines = optional ? boundaries.optional_lines : boundaries.lines;
  lines.begin_line({.kind = kind_from(properties.value("kind", ""))});
  if (!optional) boundaries.seen_within_m.push_back(seen_within_m(properties));
  for (const nlohmann::json& position : geometry.at("coordinates")) {
    const auto longitude_deg = position.at(0).get<double>(), latitude_deg = position.at(1).get<double>();
    if (!(std::abs(latitude_deg) <= 90 && std::abs(longitude_deg) <= 180)) {
      throw std::runtime_error("a position that is not on Earth (longitude first, then latitude)");
    }
    lines.push_vertex(frame.vertex(latitude_deg, longitude_deg));
  }
}

Expected<Boundaries> load_geojson(const std::filesystem::path& file, const Anchor& anchor, Origin origin) {
  std::ifstream in(file);
  if (!in) return fail(file.string() + ": cannot be read; is it a folder that roadvecd --drive wrote?");
  Boundaries boundaries;
  const LocalFrame frame(anchor);
  std::size_t feature_count = 0;
  try {
    const nlohmann::json document = nlohmann::json::parse(in);
    for (const nlohmann::json& feature : document.at("features")) {
      ++feature_count;
      add_feature(feature, frame, origin, boundaries);
    }
  } catch (const std::exception& error) {
    return fail(file.string() + (feature_count > 0 ? ": feature " + std::to_string(feature_count) : "") + ": " +
                error.what() + "; a GeoJSON FeatureCollection of LineStrings is needed");
  }
  return boundaries;
}

}  // namespace

Expected<Boundaries> load_map(const std::filesystem::path& file, const Anchor& anchor) {
  return load_geojson(file, anchor, Origin::map);
}

Expected<Boundaries> load_truth(const std::filesystem::path& file, const Anchor& anchor) {
  return load_geojson(file, anchor, Origin::truth);
}

Expected<Boundaries> load_curbstones(const std::filesystem::path& file, const Anchor& anchor) {
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_file(file.c_str());
  if (!parsed) return fail(file.string() + ": " + parsed.description() + "; an OSM XML file is needed");
  const LocalFrame frame(anchor);
  std::map<std::string, Vertex> nodes;
  for (const pugi::xml_node& node : document.child("osm").children("node")) {
    nodes[node.attribute("id").value()] =
        frame.vertex(node.attribute("lat").as_double(), node.attribute("lon").as_double());
  }
  Boundaries boundaries;
  for (const pugi::xml_node& way : document.child("osm").children("way")) {
    const pugi::xml_node tag = way.find_child_by_attribute("tag", "k", "type");
    if (std::string(tag.attribute("v").value()) != "curbstone") continue;
    boundaries.lines.begin_line({.kind = BoundaryKind::curb});
    boundaries.seen_within_m.push_back(0);
    for (const pugi::xml_node& reference : way.children("nd")) {
      const auto node = nodes.find(reference.attribute("ref").value());
      if (node != nodes.end()) boundaries.lines.push_vertex(node->second);
    }
  }
  if (boundaries.lines.empty()) return fail(file.string() + ": no ways of type curbstone; a Lanelet2 map is needed");
  return boundaries;
}

std::vector<LineSample> sample(const LineSet& lines, double spacing_m) {
  std::vector<LineSample> samples;
  for (std::uint32_t line = 0; line < lines.lines().size(); ++line) {
    const auto vertices = lines.vertices_of(lines.lines()[line]);
    double before_m = 0;
    for (std::size_t i = 0; i + 1 < vertices.size(); ++i) {
      const Eigen::Vector2d a = vertices[i].position(), leg = vertices[i + 1].position() - a;
      const double leg_m = leg.norm();
      const int steps = std::max(1, static_cast<int>(std::ceil(leg_m / spacing_m)));
      for (int k = 0; k < steps && leg_m > 0; ++k) {
        const double share = (k + 0.5) / steps;
        samples.push_back({a + share * leg, line, before_m + share * leg_m, leg_m / steps});
      }
      before_m += leg_m;
    }
  }
  return samples;
}

LineSet moved(const LineSet& lines, const Pose2& T) {
  LineSet result = lines;
  for (Vertex& vertex : result.vertices()) {
    const Eigen::Vector2d p_m = T * vertex.position();
    vertex.x_m = p_m.x();
    vertex.y_m = p_m.y();
  }
  return result;
}

double length_m(const std::vector<LineSample>& samples) {
  double sum_m = 0;
  for (const LineSample& s : samples) sum_m += s.length_m;
  return sum_m;
}

}  // namespace roadvec
