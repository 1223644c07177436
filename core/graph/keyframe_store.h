#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/line_set.h"
#include "core/pipeline/keyframe.h"

namespace roadvec {

/// A LineSet in a third of the memory: keyframes are kept for the whole drive. Positions to 2 mm, within 65 m of the
/// vehicle.
class PackedLines {
 public:
  PackedLines() = default;
  explicit PackedLines(const LineSet& lines);
  /// Adds the lines, moved by T_to_this, to `to`.
  void append_to(LineSet& to, const Pose2& T_to_this = {}) const;

 private:
  struct PackedVertex {
    std::int16_t x_2mm, y_2mm, z_2mm, height_mm;
    std::uint8_t sigma_across_2mm, sigma_along_5mm;
  };
  std::vector<PackedVertex> vertices_;
  std::vector<LineSet::Line> lines_;
};

/// What is kept of a keyframe: everything but its pose, which is the graph's.
struct KeptKeyframe {
  SensorTime time;
  Pose2 T_odom_vehicle;
  PackedLines lvm, structure;
};

}  // namespace roadvec
