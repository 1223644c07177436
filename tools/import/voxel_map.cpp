#include "tools/import/voxel_map.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

constexpr double kFewestInVoxel = 6;
/// A surface is at most this rough, and stretches at least so much farther to both sides.
constexpr double kThickest_m = 0.08, kNarrowest_m = 0.06;
constexpr double kFlatter = 2.5;

Eigen::Vector3d corner_m(const Eigen::Vector3d& point_m) {
  return (point_m / VoxelMap::kSize_m).array().floor() * VoxelMap::kSize_m;
}
/// 21 bits an axis: 1000 km at half a metre.
std::uint64_t key_of(const Eigen::Vector3d& point_m) {
  const auto part = [](double metres) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(metres / VoxelMap::kSize_m)) & 0x1FFFFF);
  };
  return part(point_m.x()) << 42 | part(point_m.y()) << 21 | part(point_m.z());
}

}  // namespace

void VoxelMap::change(const Eigen::Vector3d& point_m, double by) {
  const auto found = voxels_.try_emplace(key_of(point_m)).first;
  Voxel& voxel = found->second;
  const Eigen::Vector3d p = point_m - corner_m(point_m);
  voxel.count += by;
  if (voxel.count < 0.5) {
    voxels_.erase(found);
    return;
  }
  voxel.sum += by * p;
  voxel.products += by * p * p.transpose();
  voxel.fitted = false;
}

void VoxelMap::fit(const Voxel& voxel, const Eigen::Vector3d& corner) {
  voxel.fitted = true;
  voxel.flat = false;
  if (voxel.count < kFewestInVoxel) return;
  const Eigen::Vector3d mean = voxel.sum / voxel.count;
  const Eigen::Matrix3d covariance = voxel.products / voxel.count - mean * mean.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
  axes.computeDirect(covariance);
  const double thickness_m = std::sqrt(std::max(axes.eigenvalues()[0], 0.0));
  const double width_m = std::sqrt(std::max(axes.eigenvalues()[1], 0.0));
  voxel.flat = thickness_m < kThickest_m && width_m > kNarrowest_m && width_m > kFlatter * thickness_m;
  voxel.plane = {corner + mean, axes.eigenvectors().col(0), thickness_m};
}

const VoxelMap::Plane* VoxelMap::plane_at(const Eigen::Vector3d& point_m) const {
  const auto found = voxels_.find(key_of(point_m));
  if (found == voxels_.end()) return nullptr;
  if (!found->second.fitted) fit(found->second, corner_m(point_m));
  return found->second.flat ? &found->second.plane : nullptr;
}

}  // namespace roadvec
