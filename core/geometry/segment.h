#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace roadvec {

/// The part of a line between two points, any metric frame.
struct Segment {
  Eigen::Vector2d a, b;

  [[nodiscard]] Eigen::Vector2d direction() const { return b - a; }
  /// 0 at a, 1 at b: where the foot of p lies, kept within the segment; 0 when a == b.
  [[nodiscard]] double foot(const Eigen::Vector2d& p) const {
    const double length2 = direction().squaredNorm();
    return length2 > 0 ? std::clamp((p - a).dot(direction()) / length2, 0.0, 1.0) : 0.0;
  }
  [[nodiscard]] Eigen::Vector2d nearest(const Eigen::Vector2d& p) const { return a + foot(p) * direction(); }
  [[nodiscard]] double distance2_m2(const Eigen::Vector2d& p) const { return (p - nearest(p)).squaredNorm(); }
};

}  // namespace roadvec
