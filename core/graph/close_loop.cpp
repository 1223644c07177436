#include "core/graph/close_loop.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/graph/residuals.h"
#include "core/graph/twist.h"

namespace roadvec {
namespace {

constexpr double kCell_m = 20.0;
constexpr double kSamePlace_m = 1.5;        // choice: less than the way between two keyframes
constexpr double kHeadingStart_rad = 0.09;  // 5 deg: half of what the matcher turns back from
// Stands for "not observed" where an information matrix must be inverted: 100 m, 1 rad.
const Eigen::Vector3d kNoInformation(1e-4, 1e-4, 1.0);

// Looking around for an earlier drive: 30 m to each side. A crossing looks like the next, but for a quarter of it.
constexpr int kWideStartsPerSide = 15;
constexpr double kWideStartSpacing_m = 2.0, kWideOverlap = 0.7;
constexpr double kFullInformation = 1.0;  // weakest direction known to a metre or better

std::pair<int, int> cell_of(const Pose2& pose) {
  return {static_cast<int>(std::floor(pose.x_m / kCell_m)), static_cast<int>(std::floor(pose.y_m / kCell_m))};
}

PoseCovariance inverse_of(const Eigen::Matrix3d& information) {
  const Eigen::Matrix3d regular = information + Eigen::Matrix3d(kNoInformation.asDiagonal());
  return regular.inverse();
}

double mahalanobis2(const Eigen::Vector3d& e, const PoseCovariance& covariance) {
  return e.dot(covariance.inverse() * e);
}

double score(const Match& match) { return match.overlap - 2.0 * match.rms_m; }

/// Distance of two answers, across what neither observed.
double rivalry_m(const Match& a, const Match& b) {
  Eigen::Vector2d apart = a.pose.translation() - b.pose.translation();
  if (a.unobservable) apart -= a.unobservable->dot(apart) * *a.unobservable;
  return apart.norm();
}

}  // namespace

LoopCloser::LoopCloser(const CloseLoopConfig& config, const MatchConfig& match_config)
    : config_(config), floor_(Eigen::Matrix3d::Zero()), matcher_(match_config) {
  const double floor_rad = rad_from_deg(config.sigma_floor_deg);
  floor_.diagonal() << config.sigma_floor_m * config.sigma_floor_m, config.sigma_floor_m * config.sigma_floor_m,
      floor_rad * floor_rad;
}

bool is_full(const PoseEdge& loop) {
  const Eigen::LLT<Eigen::Matrix3d> more(loop.information - kFullInformation * Eigen::Matrix3d::Identity());
  return more.info() == Eigen::Success;
}

const std::vector<PoseEdge>& LoopCloser::run(const PoseGraph& graph, std::span<const KeptKeyframe> keyframes) {
  confirmed_.clear();
  const std::size_t newest = graph.poses_map.size() - 1;
  enter(graph, newest);
  const double here_m = graph.travelled_m[newest];
  const bool is_sure = here_m - last_confirmed_m_ < 2 * config_.sure_every_m;
  if (here_m - last_attempt_m_ < (is_sure ? config_.sure_every_m : config_.every_m)) return confirmed_;
  last_attempt_m_ = here_m;
  ++report_.attempt_count;
  const Pose2& here = graph.poses_map[newest];
  const std::optional<std::size_t> candidate = nearest_candidate(graph, here, {first_candidate_, newest});
  const Pose2 guess = candidate ? graph.poses_map[*candidate].inverse() * here : Pose2{};
  const PoseCovariance covariance =
      candidate ? relative_covariance(graph, *candidate, newest) : PoseCovariance(PoseCovariance::Zero());
  const double radius_m = config_.radius_m + 3.0 * std::sqrt(std::max(0.0, covariance(0, 0) + covariance(1, 1)));
  if (!candidate || guess.translation().norm() > radius_m) {
    ++report_.no_candidate_count;
    return confirmed_;
  }
  const std::optional<PoseEdge> edge =
      match_with(*candidate, guess, covariance,
                 {config_.max_starts_per_side, config_.start_spacing_m, config_.min_overlap}, graph, keyframes);
  if (!edge) return confirmed_;
  std::erase_if(pending_,
                [&](const Pending& p) { return graph.travelled_m[newest] - p.travelled_m > config_.window_m; });
  pending_.push_back({*edge, graph.travelled_m[newest]});
  ++report_.waiting_count;
  confirm(graph);
  return confirmed_;
}

void LoopCloser::recall(const PoseGraph& graph) {
  poses_changed(graph, 0);
  first_candidate_ = graph.poses_map.size();
}

std::optional<PoseEdge> LoopCloser::look_around(const PoseGraph& graph, std::span<const KeptKeyframe> keyframes,
                                                const Pose2& T_map_vehicle, const PoseCovariance& covariance) {
  const std::optional<std::size_t> candidate = nearest_candidate(graph, T_map_vehicle, {0, first_candidate_});
  if (!candidate) return std::nullopt;
  const Pose2 guess = graph.poses_map[*candidate].inverse() * T_map_vehicle;
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  axes.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(guess.theta_rad).toRotationMatrix();
  return match_with(*candidate, guess, axes * covariance * axes.transpose(),
                    {kWideStartsPerSide, kWideStartSpacing_m, kWideOverlap}, graph, keyframes);
}

void LoopCloser::poses_changed(const PoseGraph& graph, std::size_t first) {
  for (std::size_t k = first; k < cell_of_.size(); ++k) {
    if (cell_of_[k]) std::erase(cells_.at(*cell_of_[k]), k);
  }
  gathered_.resize(first);
  cell_of_.resize(first);
  for (std::size_t k = first; k < graph.poses_map.size(); ++k) enter(graph, k);
  last_full_loop_.reset();
  for (auto loop = graph.loops.rbegin(); loop != graph.loops.rend() && !last_full_loop_; ++loop) {
    if (loop->active && is_full(loop->edge)) last_full_loop_ = loop->edge;
  }
}

/// Covariances of odometry steps, written as small motions of the map frame, simply add up: the uncertainty between any
/// two keyframes is a difference of two sums.
void LoopCloser::enter(const PoseGraph& graph, std::size_t keyframe) {
  const Pose2& here = graph.poses_map[keyframe];
  std::vector<std::size_t>& cell = cells_[cell_of(here)];
  // A place that is known is not entered again: the search does not grow with the number of passes.
  const bool is_known = std::ranges::any_of(cell, [&](std::size_t k) {
    return (graph.poses_map[k].translation() - here.translation()).norm() < kSamePlace_m &&
           graph.travelled_m[keyframe] - graph.travelled_m[k] >= config_.min_gap_m;
  });
  cell_of_.push_back(is_known ? std::nullopt : std::optional(cell_of(here)));
  if (!is_known) cell.push_back(keyframe);
  if (keyframe == 0) {
    gathered_.assign(1, PoseCovariance::Zero());
    return;
  }
  const PoseEdge& step = graph.odometry[keyframe - 1];
  const Eigen::Matrix3d to_map =
      adjoint(graph.poses_map[keyframe - 1]) * coordinates_at(step.T_from_to.translation()).inverse();
  gathered_.push_back(gathered_.back() + to_map * inverse_of(step.information) * to_map.transpose());
}

PoseCovariance LoopCloser::chain_covariance(std::size_t from, std::size_t to) const {
  return gathered_[std::max(from, to)] - gathered_[std::min(from, to)];
}

/// Of T_from_to, in the frame of `from`: along the odometry, or by way of the last loop when that is more certain.
PoseCovariance LoopCloser::relative_covariance(const PoseGraph& graph, std::size_t from, std::size_t to) const {
  PoseCovariance twist = chain_covariance(from, to);
  if (last_full_loop_) {
    const PoseEdge& loop = *last_full_loop_;
    const Eigen::Matrix3d to_map =
        adjoint(graph.poses_map[loop.from]) * coordinates_at(loop.T_from_to.translation()).inverse();
    const PoseCovariance by_loop = chain_covariance(from, loop.from) + chain_covariance(loop.to, to) +
                                   to_map * inverse_of(loop.information) * to_map.transpose();
    if (by_loop(2, 2) < twist(2, 2)) twist = by_loop;
  }
  const Pose2 T_from_to = graph.poses_map[from].inverse() * graph.poses_map[to];
  const Eigen::Matrix3d M = coordinates_at(T_from_to.translation()) * adjoint(graph.poses_map[from].inverse());
  return M * twist * M.transpose();
}

std::optional<std::size_t> LoopCloser::nearest_candidate(const PoseGraph& graph, const Pose2& here, Range among) {
  const std::size_t newest = graph.poses_map.size() - 1;
  const auto [column, row] = cell_of(here);
  const int reach = static_cast<int>(std::ceil(config_.max_radius_m / kCell_m));
  std::optional<std::size_t> best;
  double best_m = config_.max_radius_m;
  for (int x = column - reach; x <= column + reach; ++x) {
    for (int y = row - reach; y <= row + reach; ++y) {
      const auto cell = cells_.find({x, y});
      if (cell == cells_.end()) continue;
      report_.looked_at_count += cell->second.size();
      for (const std::size_t k : cell->second) {
        if (k < among.first || k >= among.end) continue;
        if (graph.travelled_m[newest] - graph.travelled_m[k] < config_.min_gap_m) continue;
        const double distance_m = (graph.poses_map[k].translation() - here.translation()).norm();
        if (distance_m < best_m || (distance_m == best_m && best && k < *best)) {
          best = k;
          best_m = distance_m;
        }
      }
    }
  }
  return best;
}

/// The candidate's lines and those of the keyframes around it, in the candidate's frame.
void LoopCloser::collect_reference(std::size_t candidate, const PoseGraph& graph,
                                   std::span<const KeptKeyframe> keyframes) {
  reference_.clear();
  const double here_m = graph.travelled_m[candidate];
  std::size_t first = candidate;
  while (first > 0 && here_m - graph.travelled_m[first - 1] <= config_.neighbourhood_m) --first;
  std::size_t last = candidate;
  while (last + 1 < keyframes.size() && graph.travelled_m[last + 1] - here_m <= config_.neighbourhood_m) ++last;
  // The outermost two and the candidate itself show all there is; more would only repeat it.
  for (const std::size_t k : std::set<std::size_t>{first, candidate, last}) {
    const Pose2 T_candidate_k = graph.poses_map[candidate].inverse() * graph.poses_map[k];
    keyframes[k].lvm.append_to(reference_, T_candidate_k);
    keyframes[k].structure.append_to(reference_, T_candidate_k);
  }
}

/// `guess`: T_candidate_newest; `covariance`: its, in the candidate's frame.
std::optional<PoseEdge> LoopCloser::match_with(std::size_t candidate, const Pose2& guess,
                                               const PoseCovariance& covariance, const Effort& effort,
                                               const PoseGraph& graph, std::span<const KeptKeyframe> keyframes) {
  const std::size_t newest = graph.poses_map.size() - 1;
  collect_reference(candidate, graph, keyframes);
  matcher_.set_reference(reference_);
  unregistered_.clear();
  keyframes[newest].lvm.append_to(unregistered_);
  keyframes[newest].structure.append_to(unregistered_);

  const std::optional<Match> match = best_match(guess, covariance, effort);
  if (!match) return std::nullopt;
  const PoseCovariance loop_covariance = inverse_of(match->information) + floor_;
  const Eigen::Vector3d off(match->pose.x_m - guess.x_m, match->pose.y_m - guess.y_m,
                            wrap_rad(match->pose.theta_rad - guess.theta_rad));
  if (mahalanobis2(off, covariance + loop_covariance) > config_.gate_sigma * config_.gate_sigma) {
    ++report_.contradicts_odometry_count;
    return std::nullopt;
  }
  // (information^-1 + floor)^-1, written so that it holds for a singular information too.
  const Eigen::Matrix3d& I = match->information;
  const Eigen::Matrix3d information = I - I * (I + floor_.inverse()).inverse() * I;
  return PoseEdge{candidate, newest, match->pose, 0.5 * (information + information.transpose())};
}

/// The guess, and around it a raster over 3 sigma along the principal directions of its uncertainty.
std::vector<Pose2> LoopCloser::starts(const Pose2& guess, const PoseCovariance& covariance, const Effort& effort) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> principal;
  principal.computeDirect(covariance.block<2, 2>(0, 0));
  const auto count_for = [&](double variance_m2) {
    const double reach_m = 3.0 * std::sqrt(std::max(0.0, variance_m2));
    return std::min(effort.most_starts_per_side, static_cast<int>(reach_m / effort.start_spacing_m));
  };
  const int along_count = count_for(principal.eigenvalues()(1)), across_count = count_for(principal.eigenvalues()(0));
  const int turn_count = 3.0 * std::sqrt(std::max(0.0, covariance(2, 2))) > kHeadingStart_rad ? 1 : 0;
  std::vector<Pose2> poses;
  for (int turn = -turn_count; turn <= turn_count; ++turn) {
    for (int along = -along_count; along <= along_count; ++along) {
      for (int across = -across_count; across <= across_count; ++across) {
        const Eigen::Vector2d t =
            guess.translation() + effort.start_spacing_m * (along * principal.eigenvectors().col(1) +
                                                            across * principal.eigenvectors().col(0));
        poses.push_back({t.x(), t.y(), wrap_rad(guess.theta_rad + turn * kHeadingStart_rad)});
      }
    }
  }
  return poses;
}

/// The best answer of all starts, unless a different one is about as good.
std::optional<Match> LoopCloser::best_match(const Pose2& guess, const PoseCovariance& covariance,
                                            const Effort& effort) {
  const PoseCovariance no_prior = Eigen::Vector3d(1e4, 1e4, 1e2).asDiagonal();
  std::vector<Match> found;
  MatchVerdict verdict = MatchVerdict::too_few_lines;
  double best_overlap = -1;
  for (const Pose2& start : starts(guess, covariance, effort)) {
    const Match& match = matcher_.run(unregistered_, start, no_prior);
    const bool fits = match.overlap >= effort.min_overlap && match.rms_m <= config_.max_rms_m;
    if (match.usable() && fits) found.push_back(match);
    if (match.overlap > best_overlap) {
      best_overlap = match.overlap;
      verdict = match.verdict;
      if (match.usable() && match.overlap < effort.min_overlap) verdict = MatchVerdict::poor_overlap;
      if (match.usable() && match.rms_m > config_.max_rms_m) verdict = MatchVerdict::poor_fit;
    }
  }
  if (found.empty()) {
    count(verdict);
    return std::nullopt;
  }
  const Match best = *std::ranges::max_element(found, {}, score);
  const bool has_rival = std::ranges::any_of(found, [&](const Match& other) {
    return rivalry_m(best, other) > config_.distinct_m && score(other) > score(best) - config_.distinct_score;
  });
  if (has_rival) {
    ++report_.ambiguous_count;
    return std::nullopt;
  }
  return best;
}

void LoopCloser::count(MatchVerdict verdict) {
  switch (verdict) {
    case MatchVerdict::too_few_lines:
      ++report_.too_few_lines_count;
      break;
    case MatchVerdict::poor_overlap:
      ++report_.poor_overlap_count;
      break;
    case MatchVerdict::poor_fit:
      ++report_.poor_fit_count;
      break;
    case MatchVerdict::diverged:
    case MatchVerdict::accepted:
    case MatchVerdict::partly_observable:
      ++report_.diverged_count;
      break;
  }
}

bool LoopCloser::agree(const PoseGraph& graph, const PoseEdge& a, const PoseEdge& b) const {
  const Pose2 T_b_a = graph.poses_map[b.from].inverse() * graph.poses_map[a.from];
  const Pose2 T_from_a_to_b = graph.poses_map[a.to].inverse() * graph.poses_map[b.to];
  const Pose2 expected = T_b_a * a.T_from_to * T_from_a_to_b;
  const Eigen::Vector3d off(b.T_from_to.x_m - expected.x_m, b.T_from_to.y_m - expected.y_m,
                            wrap_rad(b.T_from_to.theta_rad - expected.theta_rad));
  const Eigen::Matrix3d carry =
      coordinates_at(expected.translation()) * adjoint(T_b_a) * coordinates_at(a.T_from_to.translation()).inverse();
  const PoseCovariance covariance =
      carry * inverse_of(a.information) * carry.transpose() + inverse_of(b.information) + 4.0 * floor_;
  return mahalanobis2(off, covariance) <= config_.gate_sigma * config_.gate_sigma;
}

/// Accepts the newest loop, and those waiting, once enough of the last metres' loops agree with it.
void LoopCloser::confirm(const PoseGraph& graph) {
  const PoseEdge newest = pending_.back().edge;
  std::vector<Pending*> agreeing;
  for (Pending& p : pending_) {
    if (agree(graph, p.edge, newest)) agreeing.push_back(&p);
  }
  if (agreeing.size() < static_cast<std::size_t>(config_.consistent_count)) return;
  for (Pending* p : agreeing) {
    if (p->accepted) continue;
    p->accepted = true;
    --report_.waiting_count;
    ++report_.accepted_count;
    confirmed_.push_back(p->edge);
    last_confirmed_m_ = pending_.back().travelled_m;
  }
}

}  // namespace roadvec
