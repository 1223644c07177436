#include "core/graph/find_itself.h"

#include <algorithm>

#include "core/base/square.h"
#include "core/graph/twist.h"

namespace roadvec {
namespace {

// All choices. A crossing is 20 m long, odometry over 80 m is good to some decimetres.
constexpr double kEvery_m = 4.0, kLater_m = 300.0, kEveryLater_m = 10.0;
constexpr double kStretch_m = 40.0, kWindow_m = 80.0, kShare = 0.7;
constexpr std::size_t kFewestLoops = 3;
constexpr double kDriftShare = 0.02;  ///< of the way since the start

}  // namespace

SelfFinder::SelfFinder(std::span<const StartGuess> guesses) {
  for (const StartGuess& guess : guesses) leads_.push_back({guess, {}});
}

std::vector<PoseEdge> SelfFinder::run(LoopCloser& loop_closer, const PoseGraph& graph,
                                      std::span<const KeptKeyframe> keyframes) {
  const double here_m = graph.travelled_m.back();
  const Pose2& T_odom_vehicle = keyframes.back().T_odom_vehicle;
  if (start_m_ < 0) {
    start_m_ = next_look_m_ = here_m;
    T_start_odom_ = T_odom_vehicle.inverse();
  }
  searched_m_ = here_m - start_m_;
  if (here_m < next_look_m_) return {};
  next_look_m_ = here_m + (searched_m_ < kLater_m ? kEvery_m : kEveryLater_m);
  Lead& lead = leads_[next_lead_];
  next_lead_ = (next_lead_ + 1) % leads_.size();

  // What is unsure at the start is so here, the heading as many metres more as the way is long.
  const Eigen::Matrix3d carry = adjoint((T_start_odom_ * T_odom_vehicle).inverse());
  PoseCovariance covariance = carry * lead.guess.covariance * carry.transpose();
  covariance.topLeftCorner<2, 2>() += square(kDriftShare * searched_m_) * Eigen::Matrix2d::Identity();
  std::erase_if(lead.looks, [&](const Look& look) { return here_m - look.travelled_m > kWindow_m; });
  lead.looks.push_back(
      {here_m, loop_closer.look_around(graph, keyframes, lead.guess.T_map_odom * T_odom_vehicle, covariance)});
  return agreeing(lead, loop_closer, graph);
}

/// The loops that agree with the newest, if they are enough.
std::vector<PoseEdge> SelfFinder::agreeing(const Lead& lead, const LoopCloser& loop_closer, const PoseGraph& graph) {
  const Look& newest = lead.looks.back();
  if (!newest.loop) return {};
  std::vector<PoseEdge> loops;
  double first_m = 0;
  std::size_t look_count = 0;  // since the first that agrees
  for (const Look& look : lead.looks) {
    const bool agrees = look.loop && loop_closer.agree(graph, *look.loop, *newest.loop);
    if (agrees && loops.empty()) first_m = look.travelled_m;
    if (agrees) loops.push_back(*look.loop);
    look_count += loops.empty() ? 0 : 1;
  }
  const bool is_long = newest.travelled_m - first_m >= kStretch_m;
  const bool nearly_all = static_cast<double>(loops.size()) >= kShare * static_cast<double>(look_count);
  const bool is_sure = is_long && nearly_all && loops.size() >= kFewestLoops &&
                       std::ranges::any_of(loops, [](const PoseEdge& loop) { return is_full(loop); });
  return is_sure ? loops : std::vector<PoseEdge>{};
}

}  // namespace roadvec
