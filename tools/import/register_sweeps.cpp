#include "tools/import/register_sweeps.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tools/import/voxel_map.h"

namespace roadvec {
namespace {

constexpr double kNearestPoint_m = 3, kFarthestPoint_m = 60;
constexpr std::size_t kFiringStep = 10;
constexpr std::size_t kAlignStep = 2;  ///< of the points, to be laid against the map of all
/// Sweeps on one side that a sweep is laid against: 20 m at 50 km/h.
constexpr std::size_t kWindow = 15;
constexpr int kSmoothingPasses = 2;
constexpr int kMostIterations = 30;
constexpr double kSettled_m = 1e-5;
/// Residuals beyond are outliers; while the guess is still rough, farther ones count.
constexpr double kRoughOutlier_m = 0.3, kFineOutlier_m = 0.08;
constexpr double kLeastNoise_m = 0.02;  ///< of a range [VelodyneHDL64]

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// A share of a motion that goes evenly.
Eigen::Isometry3d part_of(const Eigen::Isometry3d& motion, double share) {
  const Eigen::AngleAxisd turn(motion.linear());
  Eigen::Isometry3d part = Eigen::Isometry3d::Identity();
  part.linear() = Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  part.translation() = share * motion.translation();
  return part;
}

/// Every few points as they would be, had the LiDAR stood still in the middle of the sweep. `motion`: over the sweep.
std::vector<Eigen::Vector3d> straightened(const SweepPoints& sweep, const Eigen::Isometry3d& motion,
                                          std::size_t step = 1) {
  std::vector<Eigen::Vector3d> points_m;
  points_m.reserve(sweep.points.size() / step + 1);
  float share = -1;
  Eigen::Isometry3d T_middle_then = Eigen::Isometry3d::Identity();
  for (std::size_t i = 0; i < sweep.points.size(); i += step) {
    const SweepPoints::Point& point = sweep.points[i];
    if (point.share != share) T_middle_then = part_of(motion, static_cast<double>(share = point.share));
    points_m.push_back(T_middle_then * point.lidar_m.cast<double>());
  }
  return points_m;
}

struct Fit {
  double moved_m = 0;
  std::size_t matched_count = 0;
};

/// One step of Gauss and Newton: the pose that brings the points closer to the map's surfaces.
Fit improve(const VoxelMap& map, std::span<const Eigen::Vector3d> points_m, double outlier_m,
            Eigen::Isometry3d& T_map_lidar) {
  Matrix6 A = Matrix6::Zero();
  Vector6 b = Vector6::Zero();
  Fit fit;
  const Eigen::Vector3d centre = T_map_lidar.translation();
  for (const Eigen::Vector3d& point_m : points_m) {
    const Eigen::Vector3d p = T_map_lidar * point_m;
    const VoxelMap::Plane* plane = map.plane_at(p);
    if (plane == nullptr) continue;
    const double residual_m = plane->normal.dot(p - plane->centre_m);
    const double scaled = residual_m / outlier_m;
    if (std::abs(scaled) < 1) ++fit.matched_count;
    // Geman and McClure: outliers fade out.
    const double robust = 1 / ((1 + scaled * scaled) * (1 + scaled * scaled));
    const double noise_m = std::hypot(kLeastNoise_m, plane->thickness_m);
    Vector6 jacobian;
    jacobian << (p - centre).cross(plane->normal), plane->normal;
    const double weight = robust / (noise_m * noise_m);
    A.selfadjointView<Eigen::Lower>().rankUpdate(jacobian, weight);
    b -= weight * residual_m * jacobian;
  }
  // Where surfaces do not hold a direction, it stays as it was guessed: 1 m, 1 rad of doubt.
  A.diagonal().array() += 1.0;
  const Vector6 step = A.selfadjointView<Eigen::Lower>().ldlt().solve(b);
  const double angle_rad = step.head<3>().norm();
  if (angle_rad > 0) {
    const Eigen::AngleAxisd turn(angle_rad, step.head<3>() / angle_rad);
    T_map_lidar.linear() =
        Eigen::Quaterniond(turn.toRotationMatrix() * T_map_lidar.linear()).normalized().toRotationMatrix();
  }
  T_map_lidar.translation() += step.tail<3>();
  fit.moved_m = step.tail<3>().norm() + 20 * angle_rad;
  return fit;
}

class Registrar {
 public:
  Registrar(std::span<const SweepPoints> sweeps, const std::function<void(double)>& progress)
      : sweeps_(sweeps), progress_(progress), laid_m_(sweeps.size()) {}

  void lay_forward(const std::function<Eigen::Isometry3d(SensorTime, SensorTime)>& motion) {
    for (std::size_t i = 0; i < sweeps_.size(); ++i) {
      const SweepPoints& sweep = sweeps_[i];
      const Eigen::Isometry3d guess =
          i == 0 ? Eigen::Isometry3d::Identity() : poses_[i - 1] * motion(sweeps_[i - 1].middle(), sweep.middle());
      poses_.push_back(guess);
      if (i > 0) align(i, motion(sweep.start, sweep.end));
      add(i, i == 0 ? motion(sweep.start, sweep.end) : motion_over(i, i));
      if (i >= kWindow) remove(i - kWindow);
      report();
    }
    clear();
  }

  void lay_between(bool measured) {
    for (std::size_t i = 0; i < std::min(kWindow, sweeps_.size()); ++i) add(i, motion_over(i, i + 1));
    for (std::size_t i = 0; i < sweeps_.size(); ++i) {
      if (i + kWindow < sweeps_.size()) add(i + kWindow, motion_over(i + kWindow, i + kWindow + 1));
      remove(i);
      align(i, motion_over(i, i + 1));
      if (measured) measure(i);
      add(i, motion_over(i, i + 1));
      if (i >= kWindow) remove(i - kWindow);
      report();
    }
    clear();
  }

  [[nodiscard]] Registration result() {
    Registration result;
    if (!residuals_m_.empty()) {
      const auto middle = residuals_m_.begin() + static_cast<std::ptrdiff_t>(residuals_m_.size() / 2);
      std::nth_element(residuals_m_.begin(), middle, residuals_m_.end());
      result.residual_m = *middle;
      result.matched_share = static_cast<double>(residuals_m_.size()) / static_cast<double>(measured_count_);
    }
    const Eigen::Isometry3d T_first_map = poses_.front().inverse();
    for (const Eigen::Isometry3d& pose : poses_) result.T_first_lidar.push_back(T_first_map * pose);
    return result;
  }

 private:
  /// Over sweep `i`, from the poses of its neighbours up to `last`.
  [[nodiscard]] Eigen::Isometry3d motion_over(std::size_t i, std::size_t last) const {
    const std::size_t a = i == 0 ? 0 : i - 1, b = std::min(last, sweeps_.size() - 1);
    if (a == b) return Eigen::Isometry3d::Identity();
    const double share =
        seconds_between(sweeps_[i].start, sweeps_[i].end) / seconds_between(sweeps_[a].middle(), sweeps_[b].middle());
    return part_of(poses_[a].inverse() * poses_[b], share);
  }

  /// `motion`: over the sweep, to begin with.
  void align(std::size_t i, Eigen::Isometry3d motion) {
    std::vector<Eigen::Vector3d> points_m;
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
      if (iteration % 5 == 0) points_m = straightened(sweeps_[i], motion, kAlignStep);
      const double outlier_m = std::max(kFineOutlier_m, kRoughOutlier_m * std::pow(0.8, iteration));
      const Fit fit = improve(map_, points_m, outlier_m, poses_[i]);
      motion = motion_over(i, poses_.size() == sweeps_.size() ? i + 1 : i);
      if (outlier_m == kFineOutlier_m && fit.moved_m < kSettled_m) break;
    }
  }

  void add(std::size_t i, const Eigen::Isometry3d& motion) {
    laid_m_[i] = straightened(sweeps_[i], motion);
    for (Eigen::Vector3d& point_m : laid_m_[i]) {
      point_m = poses_[i] * point_m;
      map_.add(point_m);
    }
  }
  void clear() {
    map_ = VoxelMap();
    for (auto& points_m : laid_m_) points_m = {};
  }
  void remove(std::size_t i) {
    for (const Eigen::Vector3d& point_m : laid_m_[i]) map_.remove(point_m);
    laid_m_[i] = {};
  }
  /// How well a sweep lies on what the others have seen.
  void measure(std::size_t i) {
    for (const Eigen::Vector3d& point_m : straightened(sweeps_[i], motion_over(i, i + 1), kAlignStep)) {
      const Eigen::Vector3d p = poses_[i] * point_m;
      const VoxelMap::Plane* plane = map_.plane_at(p);
      ++measured_count_;
      if (plane != nullptr) residuals_m_.push_back(std::abs(plane->normal.dot(p - plane->centre_m)));
    }
  }
  void report() {
    progress_(static_cast<double>(++laid_count_) / static_cast<double>((1 + kSmoothingPasses) * sweeps_.size()));
  }

  std::span<const SweepPoints> sweeps_;
  const std::function<void(double)>& progress_;
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<std::vector<Eigen::Vector3d>> laid_m_;  ///< as they are in the map
  VoxelMap map_;
  std::size_t laid_count_ = 0, measured_count_ = 0;
  std::vector<double> residuals_m_;
};

}  // namespace

SweepPoints thinned(const Firings& revolution, SensorTime start, SensorTime end) {
  SweepPoints sweep{.start = start, .end = end, .points = {}};
  const double duration_s = seconds_between(start, end);
  for (std::size_t i = 0; i < revolution.firings.size(); i += kFiringStep) {
    const Firing& firing = revolution.firings[i];
    const auto share = static_cast<float>(seconds_between(start, firing.time) / duration_s - 0.5);
    for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
      if (firing.raw[laser] == 0) continue;
      const KittiPoint& point = firing.points[laser];
      const Eigen::Vector3f lidar_m(point.x_m, point.y_m, point.z_m);
      const auto range_m = static_cast<double>(lidar_m.norm());
      if (range_m >= kNearestPoint_m && range_m <= kFarthestPoint_m) sweep.points.push_back({lidar_m, share});
    }
  }
  return sweep;
}

Registration register_sweeps(std::span<const SweepPoints> sweeps,
                             const std::function<Eigen::Isometry3d(SensorTime from, SensorTime to)>& motion,
                             const std::function<void(double share)>& progress) {
  Registrar registrar(sweeps, progress);
  registrar.lay_forward(motion);
  for (int pass = 0; pass < kSmoothingPasses; ++pass) registrar.lay_between(pass + 1 == kSmoothingPasses);
  return registrar.result();
}

}  // namespace roadvec
