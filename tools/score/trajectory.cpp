#include "tools/score/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>

namespace roadvec {
namespace {

struct Pair {
  Pose2 ours, truth;
};

/// The rotation and shift that lay our positions on the true ones with the least squares.
Pose2 best_fit(const std::vector<Pair>& pairs) {
  Eigen::Vector2d ours = Eigen::Vector2d::Zero(), truth = Eigen::Vector2d::Zero();
  for (const Pair& pair : pairs) {
    ours += pair.ours.translation();
    truth += pair.truth.translation();
  }
  ours /= static_cast<double>(pairs.size());
  truth /= static_cast<double>(pairs.size());
  double dot = 0, cross = 0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector2d a = pair.ours.translation() - ours, b = pair.truth.translation() - truth;
    dot += a.dot(b);
    cross += a.x() * b.y() - a.y() * b.x();
  }
  const Pose2 turn{0, 0, std::atan2(cross, dot)};
  const Eigen::Vector2d shift = truth - turn * ours;
  return {shift.x(), shift.y(), turn.theta_rad};
}

PositionErrors errors_under(const Pose2& T_truth_ours, const std::vector<Pair>& pairs) {
  PositionErrors errors;
  double squares_m2 = 0;
  for (const Pair& pair : pairs) {
    const double error_m = (T_truth_ours * pair.ours.translation() - pair.truth.translation()).norm();
    errors.mean_m += error_m / static_cast<double>(pairs.size());
    squares_m2 += error_m * error_m / static_cast<double>(pairs.size());
    errors.max_m = std::max(errors.max_m, error_m);
  }
  errors.rms_m = std::sqrt(squares_m2);
  return errors;
}

std::optional<double> rpe_percent(const std::vector<Pair>& pairs, const std::vector<double>& way_m) {
  constexpr double kStep_m = 10;
  double sum = 0;
  std::size_t count = 0, j = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    while (j < pairs.size() && way_m[j] - way_m[i] < kStep_m) ++j;
    if (j == pairs.size()) break;
    const Eigen::Vector2d ours = (pairs[i].ours.inverse() * pairs[j].ours).translation();
    const Eigen::Vector2d truth = (pairs[i].truth.inverse() * pairs[j].truth).translation();
    sum += (ours - truth).norm() / (way_m[j] - way_m[i]);
    ++count;
  }
  if (count == 0) return std::nullopt;
  return 100 * sum / static_cast<double>(count);
}

}  // namespace

Expected<Trajectory> load_tum(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) return fail(file.string() + ": cannot be read");
  Trajectory trajectory;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::array<double, 8> v{};
    for (double& value : v) words >> value;
    const bool finite = std::all_of(v.begin(), v.end(), [](double value) { return std::isfinite(value); });
    if (!words || !finite || (!trajectory.empty() && v[0] < trajectory.back().t_s)) {
      return fail(file.string() + ":" + std::to_string(number) +
                  ": not `t x y z qx qy qz qw` by growing time; export it in the TUM format");
    }
    trajectory.push_back({v[0], {v[1], v[2], wrap_rad(2 * std::atan2(v[6], v[7]))}});
  }
  if (trajectory.empty()) return fail(file.string() + ": holds no poses");
  return trajectory;
}

std::optional<Pose2> pose_at(const Trajectory& trajectory, double t_s) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), t_s,
                                      [](const StampedPose& pose, double t) { return pose.t_s < t; });
  if (after == trajectory.end() || (after == trajectory.begin() && after->t_s > t_s)) return std::nullopt;
  if (after == trajectory.begin()) return after->T_map_vehicle;
  const StampedPose& b = *after;
  const StampedPose& a = *std::prev(after);
  const double share = b.t_s > a.t_s ? (t_s - a.t_s) / (b.t_s - a.t_s) : 0;
  const Pose2 &from = a.T_map_vehicle, &to = b.T_map_vehicle;
  return Pose2{std::lerp(from.x_m, to.x_m, share), std::lerp(from.y_m, to.y_m, share),
               wrap_rad(from.theta_rad + share * wrap_rad(to.theta_rad - from.theta_rad))};
}

Expected<TrajectoryScore> score_trajectory(const Trajectory& ours, const Trajectory& truth) {
  std::vector<Pair> pairs;
  for (const StampedPose& pose : ours) {
    if (const auto true_pose = pose_at(truth, pose.t_s)) pairs.push_back({pose.T_map_vehicle, *true_pose});
  }
  if (pairs.empty()) return fail("the trajectory and its truth share no time; are they of the same drive?");
  std::vector<double> way_m{0};
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    way_m.push_back(way_m.back() + (pairs[i].truth.translation() - pairs[i - 1].truth.translation()).norm());
  }
  TrajectoryScore score;
  score.pose_count = pairs.size();
  score.way_m = way_m.back();
  score.from_start = errors_under(pairs.front().truth * pairs.front().ours.inverse(), pairs);
  score.T_truth_ours = best_fit(pairs);
  score.aligned = errors_under(score.T_truth_ours, pairs);
  score.rpe_percent_per_10m = rpe_percent(pairs, way_m);
  return score;
}

}  // namespace roadvec
