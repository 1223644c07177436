#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "core/geometry/anchor.h"
#include "core/map/vector_map.h"

namespace roadvec {

/// The map as files for people and their programs. The same map gives the same bytes, in roadvecd and in `roadvec`.

/// GeoJSON [RFC 7946]: a FeatureCollection of LineStrings with height, WGS 84 longitude and latitude with 9 decimals
/// (0.1 mm), through the full 3-D transform at the anchor. Foreign member "anchor": where the map frame lies.
[[nodiscard]] std::string geojson_of(const VectorMap& map, const Anchor& anchor);

/// Lanelet2's OSM XML: curbstone (high, low) and road_border with height, ele at every node, nodes at least 5 cm apart;
/// vehicle rows are left out. Without lanelets: a base to draw them on. A comment says what map_projector_info.yaml is
/// to say.
[[nodiscard]] std::string lanelet2_of(const VectorMap& map, const Anchor& anchor);

/// A picture of the map frame, North up: lines coloured by kind, trajectory (if any), scale, legend. For 20 m to some
/// km.
[[nodiscard]] std::string svg_of(const VectorMap& map, std::span<const Eigen::Vector2d> trajectory,
                                 std::string_view title);

/// What a client that fetches the whole map receives: its tiles, a frame each.
[[nodiscard]] std::size_t tile_bytes(const VectorMap& map);

/// Length of all lines.
[[nodiscard]] double length_m(const VectorMap& map);

}  // namespace roadvec
