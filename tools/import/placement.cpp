#include "tools/import/placement.h"

#include <Eigen/Cholesky>
#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

/// Road beside and ahead of the car; farther off lie sidewalks.
constexpr double kRoadAhead_m = 15, kRoadBeside_m = 4;
constexpr double kRoughRoad_m = 0.3, kFineRoad_m = 0.05;
constexpr std::size_t kFewestRoadPoints = 100;
/// Between two sweeps; below, the direction is noise.
constexpr double kLeastStep_m = 0.1;
constexpr double kLeastSpeed_mps = 2;
constexpr std::int64_t kPoseTick_ns = 10'000'000;

Eigen::Matrix3d rotation(double roll_rad, double pitch_rad, double yaw_rad) {
  return (Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// z = a x + b y + c of the road around the car, in the LiDAR's frame; found from near where it must be.
std::optional<Eigen::Vector3d> road_plane(const SweepPoints& sweep, double lidar_z_m) {
  Eigen::Vector3d plane(0, 0, -lidar_z_m);
  for (double within_m = kRoughRoad_m; within_m >= kFineRoad_m; within_m /= 2) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    std::size_t count = 0;
    for (const SweepPoints::Point& point : sweep.points) {
      const Eigen::Vector3d p = point.lidar_m.cast<double>();
      const Eigen::Vector3d row(p.x(), p.y(), 1);
      if (std::abs(p.x()) > kRoadAhead_m || std::abs(p.y()) > kRoadBeside_m) continue;
      if (std::abs(p.z() - plane.dot(row)) > within_m) continue;
      A += row * row.transpose();
      b += p.z() * row;
      ++count;
    }
    if (count < kFewestRoadPoints) return std::nullopt;
    plane = A.ldlt().solve(b);
  }
  return plane;
}

/// The rear axle goes straight ahead and the LiDAR, `ahead_m` before it, swings out by what the car turns.
double mounting_yaw_rad(const Registration& registration, double ahead_m) {
  double sin_sum = 0, cos_sum = 0;
  for (std::size_t i = 1; i < registration.T_first_lidar.size(); ++i) {
    const Eigen::Isometry3d step = registration.T_first_lidar[i - 1].inverse() * registration.T_first_lidar[i];
    const double turned_rad = std::atan2(step(1, 0), step(0, 0));
    const Eigen::Vector2d way_m = Eigen::Rotation2Dd(-turned_rad / 2) * step.translation().head<2>();
    if (way_m.x() < kLeastStep_m) continue;
    const double yaw_rad = std::atan2(ahead_m * turned_rad, way_m.norm()) - std::atan2(way_m.y(), way_m.x());
    sin_sum += way_m.squaredNorm() * std::sin(yaw_rad);
    cos_sum += way_m.squaredNorm() * std::cos(yaw_rad);
  }
  return std::atan2(sin_sum, cos_sum);
}

/// Counter-clockwise from the box's heading to where the rear axle goes, over the whole drive.
double course_minus_yaw_rad(const OxtsTrack& track, SensorTime from, SensorTime to, const Eigen::Vector3d& imu_m) {
  double sin_sum = 0, cos_sum = 0;
  for (SensorTime time = from; time < to; time = time + kPoseTick_ns) {
    const OxtsSample sample = track.at(time);
    const double w = sample.rate_radps.z(), v = std::hypot(sample.north_mps, sample.east_mps);
    if (sample.forward_mps < kLeastSpeed_mps) continue;
    // The box, off the axle's middle, goes its own way while the car turns.
    const double own_rad = std::atan2(w * imu_m.x(), sample.forward_mps + w * imu_m.y());
    const double turn_rad = std::atan2(sample.north_mps, sample.east_mps) - own_rad - sample.yaw_rad;
    sin_sum += v * v * std::sin(turn_rad);
    cos_sum += v * v * std::cos(turn_rad);
  }
  return std::atan2(sin_sum, cos_sum);
}

Eigen::Isometry3d between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double share) {
  const Eigen::AngleAxisd turn(a.linear().transpose() * b.linear());
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = a.linear() * Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  pose.translation() = a.translation() + share * (b.translation() - a.translation());
  return pose;
}

}  // namespace

Eigen::Isometry3d lidar_mounting(std::span<const SweepPoints> sweeps, const Registration& registration,
                                 const KittiCar& car) {
  std::vector<double> ahead, left;
  for (const SweepPoints& sweep : sweeps) {
    const auto plane = road_plane(sweep, car.lidar_z_m);
    if (!plane) continue;
    ahead.push_back((*plane)[0]);
    left.push_back((*plane)[1]);
  }
  // The road rises ahead of a sensor that looks down, and falls to the left of one whose left side is up.
  const double pitch_rad = ahead.empty() ? 0 : std::atan(median(ahead)),
               roll_rad = left.empty() ? 0 : -std::atan(median(left));
  const double yaw_rad = mounting_yaw_rad(registration, car.lidar_x_m);
  Eigen::Isometry3d T_vehicle_lidar = Eigen::Isometry3d::Identity();
  T_vehicle_lidar.linear() = rotation(roll_rad, pitch_rad, yaw_rad);
  T_vehicle_lidar.translation() = Eigen::Vector3d(car.lidar_x_m, 0, car.lidar_z_m);
  return T_vehicle_lidar;
}

MountingDegrees angles_of(const Eigen::Matrix3d& r) {
  return {deg_from_rad(std::atan2(r(2, 1), r(2, 2))), deg_from_rad(-std::asin(std::clamp(r(2, 0), -1.0, 1.0))),
          deg_from_rad(std::atan2(r(1, 0), r(0, 0)))};
}

Eigen::Isometry3d TruthPath::at(SensorTime time) const {
  if (poses.size() == 1) return poses.front().T_map_vehicle;
  const auto later = std::upper_bound(poses.begin() + 1, poses.end() - 1, time,
                                      [](SensorTime t, const Pose& pose) { return t < pose.time; });
  const Pose &a = *(later - 1), &b = *later;
  return between(a.T_map_vehicle, b.T_map_vehicle, seconds_between(a.time, time) / seconds_between(a.time, b.time));
}

TruthPath place_path(std::span<const SweepPoints> sweeps, const Registration& registration, const OxtsTrack& track,
                     const Eigen::Isometry3d& T_vehicle_lidar, const Eigen::Isometry3d& T_vehicle_imu) {
  TruthPath path;
  const Eigen::Isometry3d T_lidar_vehicle = T_vehicle_lidar.inverse();
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    path.poses.push_back({sweeps[i].middle(), registration.T_first_lidar[i] * T_lidar_vehicle});
  }
  const SensorTime start = sweeps.front().start;
  const OxtsSample first = track.at(start);
  const Eigen::Matrix3d R_enu_vehicle =
      rotation(first.roll_rad, first.pitch_rad, first.yaw_rad) * T_vehicle_imu.linear().transpose();
  const MountingDegrees attitude = angles_of(R_enu_vehicle);
  const double yaw_rad =
      first.yaw_rad + course_minus_yaw_rad(track, start, sweeps.back().end, T_vehicle_imu.translation());
  Eigen::Isometry3d T_map_start = Eigen::Isometry3d::Identity();
  T_map_start.linear() = rotation(rad_from_deg(attitude.roll_deg), rad_from_deg(attitude.pitch_deg), yaw_rad);
  const Eigen::Isometry3d T_map_first = T_map_start * path.at(start).inverse();
  for (TruthPath::Pose& pose : path.poses) pose.T_map_vehicle = T_map_first * pose.T_map_vehicle;

  const GeographicLib::LocalCartesian at_imu(first.latitude_deg, first.longitude_deg, first.height_m);
  const Eigen::Vector3d origin_m = -(T_map_start.linear() * T_vehicle_imu.translation());
  at_imu.Reverse(origin_m.x(), origin_m.y(), origin_m.z(), path.anchor.latitude_deg, path.anchor.longitude_deg,
                 path.anchor.height_m);
  path.anchor.yaw_deg = deg_from_rad(wrap_rad(yaw_rad));
  return path;
}

void write_poses_tum(const TruthPath& path, SensorTime from, SensorTime to, OutputFile& file) {
  for (SensorTime time = from; time <= to; time = time + kPoseTick_ns) {
    const Eigen::Isometry3d pose = path.at(time);
    const Eigen::Vector3d p = pose.translation();
    const Eigen::Quaterniond q(pose.linear());
    file.write(print("%s %.4f %.4f %.4f %.7f %.7f %.7f %.7f\n", stamp(time).c_str(), p.x(), p.y(), p.z(), q.x(), q.y(),
                     q.z(), q.w()));
  }
}

}  // namespace roadvec
