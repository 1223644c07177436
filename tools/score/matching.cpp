#include "tools/score/matching.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

#include "tools/score/icp.h"

namespace roadvec {
namespace {

/// Even in +-1, the same with every standard library.
class Evenly {
 public:
  Evenly(int seed, std::size_t pair) : engine_(static_cast<std::uint64_t>(seed) * 1'000'003 + pair) {}
  double operator()() { return static_cast<double>(engine_() >> 11) * 0x1p-52 - 1; }

 private:
  std::mt19937_64 engine_;
};

Pose2 start_off(const Pose2& T, int seed, std::size_t pair) {
  Evenly evenly(seed, pair);
  const double x_m = kStartOff_m * evenly(), y_m = kStartOff_m * evenly();
  return {T.x_m + x_m, T.y_m + y_m, wrap_rad(T.theta_rad + rad_from_deg(kStartOff_deg) * evenly())};
}

/// Of starts that are off evenly: a third of the greatest square.
PoseCovariance start_covariance() {
  const double turn_rad = rad_from_deg(kStartOff_deg);
  return Eigen::Vector3d(kStartOff_m * kStartOff_m, kStartOff_m * kStartOff_m, turn_rad * turn_rad).asDiagonal() *
         (1.0 / 3);
}

struct Outcome {
  Pose2 pose;
  bool refused = false, unobserved = false;
};

const LineSet& lines_of(const MatchFrame& frame, MatchMethod method) {
  if (method == MatchMethod::sweep) return frame.sweep;
  return method == MatchMethod::raw_lvm ? frame.raw_lvm : frame.lvm;
}

Outcome run(MatchMethod method, Matcher& matcher, const MatchFrame& reference, const MatchFrame& moved,
            const Pose2& start) {
  if (method == MatchMethod::icp) return {.pose = icp(reference.points, moved.points, start).value_or(start)};
  matcher.set_reference(lines_of(reference, method));
  const Match& match = matcher.run(lines_of(moved, method), start, start_covariance());
  const bool whole = match.heading_observed && !match.unobservable;
  return {match.pose, !match.usable(), match.usable() && !whole};
}

/// Adds up one method.
class Tally {
 public:
  void add(const Outcome& outcome, const Pose2& truth, double distance_m, double time_ms) {
    const double error_m = (outcome.pose.translation() - truth.translation()).norm();
    // The two headings of a pair differ by little: the road runs along the reference's x.
    sum_.along_mean_m += std::abs(outcome.pose.x_m - truth.x_m);
    sum_.across_mean_m += std::abs(outcome.pose.y_m - truth.y_m);
    sum_.heading_mean_deg += deg_from_rad(std::abs(wrap_rad(outcome.pose.theta_rad - truth.theta_rad)));
    sum_.mean_m += error_m;
    sum_.relative_percent += 100 * error_m / distance_m;
    sum_.lost_percent += error_m > kStartOff_m ? 100 : 0;
    sum_.refused_percent += outcome.refused ? 100 : 0;
    sum_.unobserved_percent += outcome.unobserved ? 100 : 0;
    sum_.time_mean_ms += time_ms;
    errors_m_.push_back(error_m);
    times_ms_.push_back(time_ms);
  }
  [[nodiscard]] MatchingScore score() {
    MatchingScore score = sum_;
    score.count = errors_m_.size();
    const auto n = static_cast<double>(score.count);
    for (double* mean :
         {&score.mean_m, &score.relative_percent, &score.along_mean_m, &score.across_mean_m, &score.heading_mean_deg,
          &score.lost_percent, &score.refused_percent, &score.unobserved_percent, &score.time_mean_ms}) {
      *mean /= n;
    }
    std::sort(errors_m_.begin(), errors_m_.end());
    std::sort(times_ms_.begin(), times_ms_.end());
    score.median_m = errors_m_[score.count / 2];
    score.most_m = errors_m_[score.count * 95 / 100];
    score.time_p50_ms = times_ms_[score.count / 2];
    return score;
  }

 private:
  MatchingScore sum_;
  std::vector<double> errors_m_, times_ms_;
};

}  // namespace

const char* name_of(MatchMethod method) {
  constexpr std::array kNames{"icp", "sweep", "raw_lvm", "lvm"};
  return kNames[static_cast<std::size_t>(method)];
}

const char* title_of(MatchMethod method) {
  constexpr std::array kTitles{"ICP (PCL)", "single sweeps", "raw LVM", "simplified LVM"};
  return kTitles[static_cast<std::size_t>(method)];
}

MatchingScores score_matching(const std::vector<MatchFrame>& frames, const std::vector<FramePair>& pairs,
                              int seed_count, const MatchConfig& config) {
  using Clock = std::chrono::steady_clock;
  MatchingScores scores;
  scores.pair_count = pairs.size();
  scores.seed_count = seed_count;
  for (const FramePair& pair : pairs) {
    scores.distance_mean_m +=
        (frames[pair.moved].way_m - frames[pair.reference].way_m) / static_cast<double>(pairs.size());
  }
  Matcher matcher(config);
  for (const MatchMethod method : kMatchMethods) {
    if (method == MatchMethod::icp && !icp_is_built()) continue;
    Tally tally;
    for (int seed = 1; seed <= seed_count; ++seed) {
      for (std::size_t p = 0; p < pairs.size(); ++p) {
        const MatchFrame &reference = frames[pairs[p].reference], &moved = frames[pairs[p].moved];
        const Pose2 truth = reference.T_map_vehicle.inverse() * moved.T_map_vehicle;
        const Pose2 start = start_off(truth, seed, p);
        const Clock::time_point begin = Clock::now();
        const Outcome outcome = run(method, matcher, reference, moved, start);
        const std::chrono::duration<double, std::milli> time = Clock::now() - begin;
        tally.add(outcome, truth, moved.way_m - reference.way_m, time.count());
      }
    }
    scores.methods[static_cast<std::size_t>(method)] = tally.score();
  }
  return scores;
}

}  // namespace roadvec
