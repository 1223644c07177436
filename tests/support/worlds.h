#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "core/boundary/simplify.h"
#include "core/geometry/line_set.h"
#include "core/geometry/pose2.h"
#include "core/pipeline/keyframe.h"

/// Tiny hand-made worlds of lines, and what a vehicle in them would see. Every line has the free side on its right, as
/// the clockwise virtual scan makes them.
namespace roadvec::worlds {

using Points = std::vector<Eigen::Vector2d>;
using World = std::vector<Points>;

struct View {
  double range_m = 30.0;
  double spacing_m = 0.5;     ///< of the raw vertices
  double noise_m = 0.0;       ///< standard deviation of every raw vertex, across and along
  double tolerance_m = 0.05;  ///< of the simplification; 0 keeps every vertex
};

/// Points every spacing_m along a line, its own vertices included.
inline Points dense(const Points& line, double spacing_m) {
  Points points{line.front()};
  for (std::size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector2d step = line[i] - line[i - 1];
    const double count = std::max(1.0, std::ceil(step.norm() / spacing_m));
    for (double k = 1; k <= count; ++k) points.emplace_back(line[i - 1] + step * (k / count));
  }
  return points;
}

inline LineAttributes curb_attributes() {
  LineAttributes attributes;
  attributes.kind = BoundaryKind::curb;
  attributes.height_m = 0.12F;
  attributes.existence = 0.9F;
  attributes.observation_count = 10;
  return attributes;
}

inline Vertex vertex(const Eigen::Vector2d& p, double sigma_m) {
  return {p.x(), p.y(), 0.0F, 0.12F, static_cast<float>(sigma_m), static_cast<float>(2 * sigma_m)};
}

/// The world's lines as they are, in the world's frame.
inline LineSet truth(const World& world, double sigma_m = 0.02) {
  LineSet lines;
  for (const Points& line : world) {
    lines.begin_line(curb_attributes());
    for (const Eigen::Vector2d& p : line) lines.push_vertex(vertex(p, sigma_m));
  }
  return lines;
}

/// Local vector map seen from a pose: within range, noisy, simplified, in the vehicle frame. Lines are cut where they
/// leave.
inline LineSet seen_from(const World& world, const Pose2& T_world_vehicle, const View& view, std::mt19937_64& random) {
  std::normal_distribution<double> gauss(0.0, 1.0);
  const Pose2 T_vehicle_world = T_world_vehicle.inverse();
  const double sigma_m = std::max(0.02, view.noise_m);
  LineSet raw;
  for (const Points& line : world) {
    bool open = false;
    for (const Eigen::Vector2d& p_world : dense(line, view.spacing_m)) {
      const Eigen::Vector2d p = T_vehicle_world * p_world;
      if (p.norm() > view.range_m) {
        open = false;
        continue;
      }
      if (!open) raw.begin_line(curb_attributes());
      open = true;
      const double dx = gauss(random), dy = gauss(random);
      raw.push_vertex(vertex(p + view.noise_m * Eigen::Vector2d(dx, dy), sigma_m));
    }
  }
  LineSet kept;
  Simplifier simplifier({.tolerance_m = std::max(1e-9, view.tolerance_m)});
  for (const LineSet::Line& line : raw.lines()) {
    if (line.count < 2) continue;
    const std::span<const Vertex> vertices = raw.vertices_of(line);
    kept.begin_line(line.attributes);
    for (const std::uint32_t i : simplifier.kept(vertices)) kept.push_vertex(vertices[i]);
  }
  return kept;
}

/// Straight street along x: right kerb at y = -half, left kerb at y = +half.
inline World straight_street(double from_m, double to_m, double half_width_m = 4.0) {
  // Seen from the middle, clockwise: the left kerb runs ahead, the right kerb runs back.
  return {{{from_m, half_width_m}, {to_m, half_width_m}}, {{to_m, -half_width_m}, {from_m, -half_width_m}}};
}

/// Crossing of two 8 m streets at the origin: four corners with rounded kerbs, open mouths.
inline World crossing(double reach_m = 40.0, double half_width_m = 4.0, double radius_m = 3.0) {
  World world;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const double turn_rad = quarter * kPi / 2;
    const Pose2 turn{0, 0, turn_rad};
    // Corner at the upper left, seen from the middle clockwise: in from the left arm, out along the upper arm.
    const double start = half_width_m + radius_m;
    Points corner{{-reach_m, half_width_m}, {-start, half_width_m}};
    for (int k = 1; k < 8; ++k) {
      const double a = k * (kPi / 2) / 8;
      corner.emplace_back(-start + radius_m * std::sin(a), start - radius_m * std::cos(a));
    }
    corner.emplace_back(-half_width_m, start);
    corner.emplace_back(-half_width_m, reach_m);
    for (Eigen::Vector2d& p : corner) p = turn * p;
    world.push_back(corner);
  }
  return world;
}

/// Street of 8 m around a block: the centre line is a rectangle from the origin, corners square, some bays in the outer
/// kerb.
inline World block_street(double width_m = 110.0, double depth_m = 70.0, double half_width_m = 4.0) {
  const double h = half_width_m;
  // Outer kerb, clockwise seen from above: the street inside it is on the right. Bays 2 m deep break the straights.
  Points outer{{-h, -h}, {-h, depth_m + h}};
  const auto bay = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& along, const Eigen::Vector2d& out) {
    for (const Eigen::Vector2d& p : {Eigen::Vector2d(from), Eigen::Vector2d(from + 2 * out),
                                     Eigen::Vector2d(from + 2 * out + 6 * along), Eigen::Vector2d(from + 6 * along)}) {
      outer.push_back(p);
    }
  };
  bay({25, depth_m + h}, {1, 0}, {0, 1});
  bay({70, depth_m + h}, {1, 0}, {0, 1});
  outer.insert(outer.end(), {{width_m + h, depth_m + h}, {width_m + h, -h}});
  bay({80, -h}, {-1, 0}, {0, -1});
  bay({40, -h}, {-1, 0}, {0, -1});
  outer.push_back({-h, -h});
  // The block itself, counter-clockwise.
  return {outer, {{h, h}, {width_m - h, h}, {width_m - h, depth_m - h}, {h, depth_m - h}, {h, h}}};
}

/// Poses every step_m along a path whose corners are rounded by radius_m.
inline std::vector<Pose2> drive_along(const Points& path, double step_m = 2.0, double radius_m = 6.0) {
  Points line{path.front()};
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    const Eigen::Vector2d in = (path[i] - path[i - 1]).normalized(), out = (path[i + 1] - path[i]).normalized();
    for (int k = 0; k <= 10; ++k) {
      // Quadratic curve from radius_m before the corner to radius_m after it.
      const double t = k / 10.0;
      line.emplace_back(path[i] - (1 - t) * (1 - t) * radius_m * in + t * t * radius_m * out);
    }
  }
  line.push_back(path.back());
  std::vector<Pose2> poses;
  double until_next_m = 0;
  for (std::size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector2d step = line[i] - line[i - 1];
    const double length_m = step.norm();
    for (; until_next_m < length_m; until_next_m += step_m) {
      const Eigen::Vector2d p = line[i - 1] + step * (until_next_m / length_m);
      poses.push_back({p.x(), p.y(), std::atan2(step.y(), step.x())});
    }
    until_next_m -= length_m;
  }
  return poses;
}

/// Odometry that drifts: speed scale and heading bias the same all the way, and a little noise; the covariance knows.
struct Drift {
  double scale = 0.001;
  double bias_radpm = 0.0002;
  double noise_m = 0.005, noise_rad = 0.0005;  ///< per step
  double sigma_m = 0.05, sigma_rad = 0.004;    ///< claimed per step
};

/// Keyframes of a drive through a world, as a front end with that drift would hand them over.
inline std::vector<Keyframe> keyframes_of(const World& world, const std::vector<Pose2>& truth, const View& view,
                                          const Drift& drift, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss(0.0, 1.0);
  std::vector<Keyframe> keyframes(truth.size());
  for (std::size_t k = 0; k < truth.size(); ++k) {
    Keyframe& keyframe = keyframes[k];
    keyframe.index = k;
    keyframe.time = {static_cast<std::int64_t>(k) * 200'000'000};
    keyframe.lvm = seen_from(world, truth[k], view, random);
    keyframe.T_odom_vehicle = truth[0];
    if (k == 0) continue;
    Pose2 step = truth[k - 1].inverse() * truth[k];
    const double length_m = step.translation().norm();
    step.x_m = step.x_m * (1 + drift.scale) + drift.noise_m * gauss(random);
    step.y_m += drift.noise_m * gauss(random);
    step.theta_rad += drift.bias_radpm * length_m + drift.noise_rad * gauss(random);
    keyframe.T_odom_vehicle = keyframes[k - 1].T_odom_vehicle * step;
    keyframe.covariance_since_previous =
        Eigen::Vector3d(drift.sigma_m * drift.sigma_m, drift.sigma_m * drift.sigma_m, drift.sigma_rad * drift.sigma_rad)
            .asDiagonal();
    keyframe.travelled_m = keyframes[k - 1].travelled_m + length_m;
  }
  return keyframes;
}

}  // namespace roadvec::worlds
