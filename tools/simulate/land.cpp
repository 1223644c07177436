#include "tools/simulate/land.h"

#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

Eigen::Vector2d direction(double heading_deg) {
  return {std::cos(rad_from_deg(heading_deg)), std::sin(rad_from_deg(heading_deg))};
}

}  // namespace

Land::Land(const Scene& scene) : slope_(scene.slope_percent / 100 * direction(scene.slope_heading_deg)) {
  for (const HillSpec& hill : scene.hills) {
    const Eigen::Vector2d along = direction(hill.heading_deg);
    hills_.push_back(
        {hill.at_m, hill.height_m, along / hill.along_m, Eigen::Vector2d(-along.y(), along.x()) / hill.across_m});
  }
}

double Land::height_m(const Eigen::Vector2d& point_m) const {
  double height_m = slope_.dot(point_m);
  for (const Hill& hill : hills_) {
    const Eigen::Vector2d offset = point_m - hill.at_m;
    const double along = hill.along_1pm.dot(offset), across = hill.across_1pm.dot(offset);
    height_m += hill.height_m * std::exp(-0.5 * (along * along + across * across));
  }
  return height_m;
}

}  // namespace roadvec
