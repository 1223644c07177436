#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/geometry/pose2.h"

namespace roadvec {

/// The opponent: point-to-point ICP of PCL in the plane. icp_pcl.cpp, or icp_absent.cpp where PCL is missing.
[[nodiscard]] bool icp_is_built();
/// T_reference_moved, from a guess; empty: not built.
[[nodiscard]] std::optional<Pose2> icp(const std::vector<Eigen::Vector2d>& reference_m,
                                       const std::vector<Eigen::Vector2d>& moved_m, const Pose2& guess);

}  // namespace roadvec
