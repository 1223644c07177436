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
  /// Of a truth: lines that a map may have or lack. Lower than kLeastHeight_m (dropped kerbs, verges), or `removed`
  /// while the drive went on.
  LineSet optional_lines;
};
inline constexpr double kLeastHeight_m = 0.05;

/// LineStrings of a GeoJSON file (WGS 84) with a `kind`. Errors name file and feature.
[[nodiscard]] Expected<Boundaries> load_map(const std::filesystem::path& file, const Anchor& anchor);
/// The same with what truth files say of each line: `seen_within_m`, `height_m`, `removed`.
[[nodiscard]] Expected<Boundaries> load_truth(const std::filesystem::path& file, const Anchor& anchor);

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

[[nodiscard]] LineSet moved(const LineSet& lines, const Pose2& T);
[[nodiscard]] double length_m(const std::vector<LineSample>& samples);

}  // namespace roadvec
