#pragma once

#include "tools/simulate/scene.h"

namespace roadvec {

/// Height of the bare land: one incline and Gaussian hills. Smooth everywhere, so that grades and crests are too.
class Land {
 public:
  explicit Land(const Scene& scene);

  [[nodiscard]] double height_m(const Eigen::Vector2d& point_m) const;

 private:
  struct Hill {
    Eigen::Vector2d at_m;
    double height_m;
    Eigen::Vector2d along_1pm, across_1pm;  ///< axes over their sigmas
  };
  Eigen::Vector2d slope_;
  std::vector<Hill> hills_;
};

}  // namespace roadvec
