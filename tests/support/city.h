#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "core/base/square.h"
#include "core/graph/pose_graph.h"
#include "tests/support/worlds.h"

/// A city as lines, for drives of any length: square blocks between streets 8 m wide, every block with its own bays.
namespace roadvec::worlds {

class City {
 public:
  static constexpr double kPitch_m = 100.0, kHalfStreet_m = 4.0;

  /// `side`: crossings per side; streets run along x = 0, 100, ... and y = 0, 100, ...
  explicit City(int side, unsigned seed = 1) : side_(side) {
    std::mt19937_64 random(seed);
    for (int row = -1; row < side; ++row) {
      for (int column = -1; column < side; ++column) blocks_.push_back(block(column, row, random));
    }
  }

  /// Keeps right, turns where chance says, comes by everywhere and in both directions; never turns back.
  [[nodiscard]] std::vector<Pose2> drive(double length_m, unsigned seed) const {
    std::mt19937_64 random(seed);
    constexpr std::array<std::pair<int, int>, 4> kWays{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
    int column = side_ / 2, row = side_ / 2;
    std::size_t way = 0;
    Points path{{kPitch_m * column, kPitch_m * row}};
    for (double driven_m = 0; driven_m < length_m; driven_m += kPitch_m) {
      const auto goes_on = [&](std::size_t w) {
        const int c = column + kWays[w].first, r = row + kWays[w].second;
        return c >= 0 && r >= 0 && c < side_ && r < side_;
      };
      std::size_t next = (way + 3 + random() % 3) % 4;
      while (!goes_on(next) || next == (way + 2) % 4) next = (way + 3 + random() % 3) % 4;
      way = next;
      column += kWays[way].first;
      row += kWays[way].second;
      path.emplace_back(kPitch_m * column, kPitch_m * row);
    }
    std::vector<Pose2> poses = drive_along(path);
    for (Pose2& pose : poses) pose = pose * Pose2{0, -1.5, 0};
    return poses;
  }

  /// The blocks around a place.
  [[nodiscard]] World around(const Eigen::Vector2d& p) const {
    World world;
    const int column = static_cast<int>(std::floor(p.x() / kPitch_m + 0.5)),
              row = static_cast<int>(std::floor(p.y() / kPitch_m + 0.5));
    for (int r = row - 1; r <= row; ++r) {
      for (int c = column - 1; c <= column; ++c) {
        if (c < -1 || r < -1 || c >= side_ || r >= side_) continue;
        world.push_back(blocks_[static_cast<std::size_t>((r + 1) * (side_ + 1) + c + 1)]);
      }
    }
    return world;
  }

 private:
  /// Counter-clockwise, so that the street is on the right. Two bays on each side, 2 m deep.
  static Points block(int column, int row, std::mt19937_64& random) {
    std::uniform_real_distribution<double> share(0.0, 1.0);
    const double inner_m = kPitch_m - 2 * kHalfStreet_m;
    Points points;
    for (int side = 0; side < 4; ++side) {
      const Pose2 turn{0, 0, side * kPi / 2};
      const Eigen::Vector2d middle(kPitch_m * (column + 0.5), kPitch_m * (row + 0.5));
      const auto put = [&](double along_m, double in_m) {
        points.push_back(middle + turn * Eigen::Vector2d(along_m - inner_m / 2, -inner_m / 2 + in_m));
      };
      put(0, 0);
      for (const double from_m : {10 + 25 * share(random), 50 + 20 * share(random)}) {
        const double length_m = 4 + 8 * share(random);
        put(from_m, 0), put(from_m, 2), put(from_m + length_m, 2), put(from_m + length_m, 0);
      }
    }
    points.push_back(points.front());
    return points;
  }
  int side_;
  std::vector<Points> blocks_;  // row by row, from -1 on
};

/// One keyframe after the other of a drive through a city, as a front end with that drift would hand them over.
class CityDrive {
 public:
  CityDrive(const City& city, std::vector<Pose2> truth, const View& view, const Drift& drift, unsigned seed)
      : city_(city), truth_(std::move(truth)), view_(view), drift_(drift), random_(seed) {}
  /// False: the drive is over.
  bool next() {
    const std::size_t k = count_++;
    if (k >= truth_.size()) return false;
    keyframe.index = k;
    keyframe.time = {static_cast<std::int64_t>(k) * 200'000'000};
    keyframe.lvm = seen_from(city_.around(truth_[k].translation()), truth_[k], view_, random_);
    if (k == 0) {
      keyframe.T_odom_vehicle = truth_[0];
      return true;
    }
    std::normal_distribution<double> gauss(0.0, 1.0);
    Pose2 step = truth_[k - 1].inverse() * truth_[k];
    const double length_m = step.translation().norm();
    step.x_m = step.x_m * (1 + drift_.scale) + drift_.noise_m * gauss(random_);
    step.y_m += drift_.noise_m * gauss(random_);
    step.theta_rad += drift_.bias_radpm * length_m + drift_.noise_rad * gauss(random_);
    keyframe.T_odom_vehicle = keyframe.T_odom_vehicle * step;
    keyframe.covariance_since_previous =
        Eigen::Vector3d(square(drift_.sigma_m), square(drift_.sigma_m), square(drift_.sigma_rad)).asDiagonal();
    keyframe.travelled_m += length_m;
    return true;
  }
  Keyframe keyframe;
  [[nodiscard]] const std::vector<Pose2>& truth() const { return truth_; }

 private:
  const City& city_;
  std::vector<Pose2> truth_;
  View view_;
  Drift drift_;
  std::mt19937_64 random_;
  std::size_t count_ = 0;
};

/// A good car's: 0.1 % of the way, half a degree per kilometre and some noise; the covariance knows.
inline Drift city_drift() {
  return {
      .scale = 0.001, .bias_radpm = 1e-5, .noise_m = 0.005, .noise_rad = 0.0003, .sigma_m = 0.01, .sigma_rad = 0.0007};
}

/// Loops that are more than 1 m or 2 degrees from the truth.
inline std::size_t count_false(std::span<const LoopEdge> loops, const std::vector<Pose2>& truth) {
  return static_cast<std::size_t>(std::ranges::count_if(loops, [&](const LoopEdge& loop) {
    const Pose2 apart = loop.edge.T_from_to.inverse() * (truth[loop.edge.from].inverse() * truth[loop.edge.to]);
    return apart.translation().norm() > 1.0 || std::abs(apart.theta_rad) > rad_from_deg(2.0);
  }));
}

}  // namespace roadvec::worlds
