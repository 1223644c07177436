#include "tools/score/icp.h"

namespace roadvec {

bool icp_is_built() { return false; }

std::optional<Pose2> icp(const std::vector<Eigen::Vector2d>&, const std::vector<Eigen::Vector2d>&, const Pose2&) {
  return std::nullopt;
}

}  // namespace roadvec
