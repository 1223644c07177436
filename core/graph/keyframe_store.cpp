#include "core/graph/keyframe_store.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadvec {
namespace {

/// Nearest whole number of units; what does not fit is put at the limit.
template <class Integer>
Integer packed(double value_m, double unit_m) {
  constexpr auto low = static_cast<double>(std::numeric_limits<Integer>::min());
  constexpr auto high = static_cast<double>(std::numeric_limits<Integer>::max());
  return static_cast<Integer>(std::clamp(std::round(value_m / unit_m), low, high));
}

}  // namespace

PackedLines::PackedLines(const LineSet& lines) : lines_(lines.lines().begin(), lines.lines().end()) {
  vertices_.reserve(lines.vertices().size());
  for (const Vertex& v : lines.vertices()) {
    vertices_.push_back({packed<std::int16_t>(v.x_m, 0.002), packed<std::int16_t>(v.y_m, 0.002),
                         packed<std::int16_t>(v.z_m, 0.002), packed<std::int16_t>(v.height_m, 0.001),
                         packed<std::uint8_t>(v.sigma_across_m, 0.002), packed<std::uint8_t>(v.sigma_along_m, 0.005)});
  }
}

void PackedLines::append_to(LineSet& to, const Pose2& T_to_this) const {
  for (const LineSet::Line& line : lines_) {
    to.begin_line(line.attributes);
    for (std::uint32_t i = line.first; i < line.first + line.count; ++i) {
      const PackedVertex& v = vertices_[i];
      const Eigen::Vector2d p = T_to_this * Eigen::Vector2d(v.x_2mm * 0.002, v.y_2mm * 0.002);
      to.push_vertex({p.x(), p.y(), static_cast<float>(v.z_2mm * 0.002), static_cast<float>(v.height_mm * 0.001),
                      static_cast<float>(v.sigma_across_2mm * 0.002), static_cast<float>(v.sigma_along_5mm * 0.005)});
    }
  }
}

}  // namespace roadvec
