#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <unordered_map>

namespace roadvec {

/// Points gathered in cubes, each known by its mean and spread: surfaces to lay other points against.
class VoxelMap {
 public:
  /// A flat piece of surface.
  struct Plane {
    Eigen::Vector3d centre_m, normal;
    double thickness_m = 0;  ///< standard deviation along the normal
  };

  void add(const Eigen::Vector3d& point_m) { change(point_m, 1); }
  /// A point that was added before.
  void remove(const Eigen::Vector3d& point_m) { change(point_m, -1); }
  /// The surface in the cube of `point_m`; null where there is none, too few points or nothing flat. Valid until the
  /// map changes.
  [[nodiscard]] const Plane* plane_at(const Eigen::Vector3d& point_m) const;

  static constexpr double kSize_m = 0.5;

 private:
  struct Voxel {
    double count = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();  ///< relative to the cube's corner, for precision
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    mutable bool fitted = false, flat = false;
    mutable Plane plane;
  };
  void change(const Eigen::Vector3d& point_m, double by);
  static void fit(const Voxel& voxel, const Eigen::Vector3d& corner_m);

  std::unordered_map<std::uint64_t, Voxel> voxels_;
};

}  // namespace roadvec
