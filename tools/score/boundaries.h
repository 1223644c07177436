#pragma once

#include <filesystem>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/anchor.h"
#include "core/geometry/line_set.h"

namespace roadvec {

/// Boundary lines in the map frame (East-North-Up at the anchor), ours or true.
struct Boundaries {
  LineSet lines;
  /// Per line: the nearest distance at which the sensor saw it. 0: the file does not say; infinity: never.
  std::vector<double> seen_within_m;
};

/// LineStrings of a GeoJSON file (WGS 84) with a `kind` and, in truth files, `seen_within_m`. Errors name file and
/// feature.
[[nodiscard]] Expected<Boundaries> load_geojson(const std::filesystem::path& file, const Anchor& anchor);

/// The ways of type `curbstone` of a Lanelet2 map (OSM XML), as curbs.
[[nodiscard]] Expected<Boundaries> load_curbstones(const std::filesystem::path& file, const Anchor& anchor);

/// A point of a line, standing for `length_m` of it.
struct LineSample {
  Eigen::Vector2d position_m;
  std::uint32_t line = 0;
  double along_m = 0;  ///< from the line's first vertex
  double length_m = 0;
};
/// Every `spacing_m` or a little closer, in order.
[[nodiscard]] std::vector<LineSample> sample(const LineSet& lines, double spacing_m);

[[nodiscard]] double length_m(const std::vector<LineSample>& samples);

}  // namespace roadvec
