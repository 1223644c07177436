#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/base/angle.h"
#include "tools/recording/output_file.h"

namespace roadvec {

/// A drive of KITTI's form that a car at even speed makes in an oblong yard, scanned by a made-up head through the
/// formula of the HDL-64E's manual; written here anew, so that nothing of the importer is in it.
struct MadeKitti {
  static constexpr int kLasers = 64;
  static constexpr double kSpeed_mps = 6, kYawRate_radps = 0.2, kSweep_s = 0.1;
  static constexpr std::int64_t kStart_ns = 1'317'042'272'000'000'000;

  /// Of laser i.
  static double elevation_rad(int i) { return rad_from_deg(i < 32 ? 2 - 0.33 * i : -8.8 - 0.5 * (i - 32)); }
  static double rotation_rad(int i) {
    return rad_from_deg(std::array{-5.0, -1.7, 1.6, 5.1}[static_cast<std::size_t>(i) % 4] + 0.017 * (i - 31.5));
  }
  static double up_m(int i) { return i < 32 ? 0.209 - 0.0003 * i : 0.126 - 0.0004 * (i - 32); }
  static double side_m(int i) { return i % 2 == 0 ? -0.026 : 0.026; }
  static double distance_m(int i) { return 1.2 + 0.0003 * (i % 7); }

  /// The LiDAR above the rear axle, upright: 0.76 m ahead.
  static Eigen::Isometry3d lidar_at(double time_s) {
    const double turned_rad = kYawRate_radps * time_s, radius_m = kSpeed_mps / kYawRate_radps;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(turned_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    pose.translation() = Eigen::Vector3d(radius_m * std::sin(turned_rad), radius_m * (1 - std::cos(turned_rad)), 0) +
                         pose.linear() * Eigen::Vector3d(0.76, 0, 1.73);
    return pose;
  }

  /// To the ground, walls at x -20 and 30, y -3.2 and 4: near enough that every laser sees more than a circle.
  static double range_m(const Eigen::Vector3d& from_m, const Eigen::Vector3d& direction) {
    double nearest_m = 1e9;
    const auto meet = [&](int axis, double at_m) {
      const double range = (at_m - from_m[axis]) / direction[axis];
      if (range > 0) nearest_m = std::min(nearest_m, range);
    };
    meet(2, 0);
    meet(0, -20);
    meet(0, 30);
    meet(1, -3.2);
    meet(1, 4);
    return nearest_m;
  }

  struct Point {
    double bearing_rad;
    std::array<float, 4> values;
  };

  /// Laser by laser, each from straight ahead round to the left, to the millimetre; the last point is at the origin.
  static std::vector<float> scan(int frame) {
    constexpr int kFirings = 2149;
    std::array<std::vector<Point>, kLasers> lasers;
    for (int n = 0; n < kFirings; ++n) {
      // Evenly turning, read in steps of 0.09 degrees.
      const double cells = std::floor(2001 + frame * 0.3 + n * 4000.0 / kFirings);
      const double time_s = frame * kSweep_s + n * kSweep_s / kFirings;
      const Eigen::Isometry3d pose = lidar_at(time_s);
      for (int i = 0; i < kLasers; ++i) {
        const double a = rad_from_deg(0.09 * cells) - rotation_rad(i), V = elevation_rad(i);
        const Eigen::Vector3d direction(std::cos(V) * std::cos(a), -std::cos(V) * std::sin(a), std::sin(V));
        const Eigen::Vector3d origin(side_m(i) * std::sin(a), side_m(i) * std::cos(a), up_m(i));
        const double range = range_m(pose * origin, pose.linear() * direction);
        if (range > 70) continue;
        const double measured = distance_m(i) + 0.002 * std::round((range - distance_m(i)) / 0.002);
        const Eigen::Vector3d p = origin + measured * direction;
        const auto mm = [](double metres) { return static_cast<float>(std::round(metres * 1000) / 1000); };
        double bearing = std::atan2(p.y(), p.x());
        if (bearing < 0) bearing += kTwoPi;
        lasers[static_cast<std::size_t>(i)].push_back({bearing, {mm(p.x()), mm(p.y()), mm(p.z()), 0.32F}});
      }
    }
    std::vector<float> values;
    for (auto& laser : lasers) {
      std::sort(laser.begin(), laser.end(),
                [](const Point& a, const Point& b) { return a.bearing_rad < b.bearing_rad; });
      for (const Point& point : laser) values.insert(values.end(), point.values.begin(), point.values.end());
    }
    values.insert(values.end(), {0, 0, 0, 0});
    return values;
  }

  static void write(const std::filesystem::path& path, const std::string& bytes) {
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
  }
  static std::string bytes_of(const std::vector<float>& values) {
    std::string bytes(4 * values.size(), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
  }
  static std::string time_text(double time_s) { return print("2011-09-26 13:04:%012.9f\n", 32 + time_s); }

  /// Everything but the scans. The OXTS box stands over the rear axle; its velocities are late.
  static void write_frame_of_drive(const std::filesystem::path& drive, int frame_count) {
    write(drive.parent_path() / "calib_imu_to_velo.txt",
          "calib_time: 25-May-2012 16:47:16\nR: 1 0 0 0 1 0 0 0 1\nT: -0.76 0 -0.8\n");
    std::string starts, ends, times;
    for (int i = 0; i < frame_count; ++i) {
      starts += time_text(i * kSweep_s);
      ends += time_text((i + 1) * kSweep_s);
      times += time_text((i + 0.5) * kSweep_s);
      const double yaw_rad = kYawRate_radps * (i + 0.5) * kSweep_s;
      const double course_rad = yaw_rad - kYawRate_radps * 0.065;
      write(
          drive / "oxts/data" / print("%010d.txt", i),
          print(
              "49.0 8.4 112.0 0 0 %.9f %.9f %.9f %.9f 0 0 0 %.9f 9.81 0 0 9.81 0 0 %.9f 0 0 %.9f 0.5 0.07 4 10 4 4 0\n",
              yaw_rad, kSpeed_mps * std::sin(course_rad), kSpeed_mps * std::cos(course_rad), kSpeed_mps,
              kSpeed_mps * kYawRate_radps, kYawRate_radps, kYawRate_radps));
    }
    write(drive / "oxts/timestamps.txt", times);
    write(drive / "velodyne_points/timestamps_start.txt", starts);
    write(drive / "velodyne_points/timestamps_end.txt", ends);
  }
  static std::filesystem::path scan_path(const std::filesystem::path& drive, int frame) {
    return drive / "velodyne_points/data" / print("%010d.bin", frame);
  }
};

}  // namespace roadvec
