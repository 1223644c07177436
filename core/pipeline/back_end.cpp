#include "core/pipeline/back_end.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "core/base/ensure.h"
#include "core/base/square.h"

namespace roadvec {
namespace {

// Below this a correction is rounding, not a jump that clients must be told of.
constexpr double kJump_m = 1e-4;
// When the map is derived again, what moved by this share of the shift that calls for it is taken along.
constexpr double kMovedShare = 0.2;
constexpr double kJumpLeverage_m = 20.0;  // a turn counts at the distance of the lines it moves
constexpr double kAnywhere_m = 1000.0;
constexpr std::size_t kRecalledAtOnce = 25;  // keyframes: choice, as much work again as a closure's

double shift_m(const Pose2& from, const Pose2& to) {
  return (to.translation() - from.translation()).norm() +
         kJumpLeverage_m * std::abs(wrap_rad(to.theta_rad - from.theta_rad));
}

/// Keeps a step that claims to be exact (zero covariance) invertible: a tenth of a millimetre, a thousandth of a
/// degree.
Eigen::Matrix3d information_of(const PoseCovariance& covariance) {
  const Eigen::Matrix3d floor = Eigen::Vector3d(1e-8, 1e-8, 3e-10).asDiagonal();
  return (covariance + floor).ldlt().solve(Eigen::Matrix3d::Identity());
}

}  // namespace

BackEnd::BackEnd(const PipelineConfig& config, const Pose2& T_map_odom_start, StepProbe& probe,
                 std::uint64_t first_keyframe)
    : config_(config),
      probe_(probe),
      first_keyframe_(first_keyframe),
      loop_closer_(config.close_loop, config.match),
      optimiser_(config.optimise),
      concatenator_(config.concatenate),
      T_map_odom_(T_map_odom_start) {}

void BackEnd::recall(Recollection recollection) {
  ENSURE(keyframes_.empty() && !recollection.keyframes.empty() && !recollection.guesses.empty());
  graph_ = std::move(recollection.graph);
  keyframes_ = std::move(recollection.keyframes);
  recalled_count_ = keyframes_.size();
  mapped_poses_.resize(recalled_count_);
  first_lagging_ = recalled_count_;
  // Kept poses are those of their time: what later loops moved is solved for again.
  if (!graph_.loops.empty()) optimiser_.run(graph_, 1);
  loop_closer_.recall(graph_);
  T_map_odom_ = recollection.guesses.front().T_map_odom;
  self_finder_.emplace(recollection.guesses);
  last_closure_m_ = last_whole_m_ = last_rederived_m_ = graph_.travelled_m.back() + config_.close_loop.min_gap_m;
  report_.recalled_keyframe_count = recalled_count_;
  report_.found_itself = false;
}

const MapChange& BackEnd::add(const Keyframe& keyframe) {
  probe_.begin();
  take(keyframe);
  const std::vector<PoseEdge>& loops = loop_closer_.run(graph_, keyframes_);  // 7 close_loop
  probe_.done(Step::close_loop);

  optimise_for(loops);  // 8 optimise
  if (self_finder_) find_itself();
  probe_.done(Step::optimise);

  if (due_again()) rederive();  // 9 concatenate
  recall_lines(kRecalledAtOnce);
  mapped_poses_.emplace_back(graph_.poses_map.back());
  concatenate(keyframes_.size() - 1);
  concatenator_.publish(false, change_);
  probe_.done(Step::concatenate);

  count_changes();
  return change_;
}

const MapChange& BackEnd::finish() {
  probe_.begin();
  change_ = MapChange{};
  change_.T_map_odom = T_map_odom_;
  if (!trajectory_.empty()) change_.time = trajectory_.back().time;
  if (unsolved_loops_ || last_whole_m_ < last_closure_m_) optimise(true);
  probe_.done(Step::optimise);
  if (map_lag_m_ > config_.optimise.rederive_shift_m) rederive();
  recall_lines(to_recall_.size());
  concatenator_.publish(true, change_);
  probe_.done(Step::concatenate);
  count_changes();
  return change_;
}

void BackEnd::take(const Keyframe& keyframe) {
  const std::size_t newest = keyframes_.size();
  ENSURE(keyframe.index == first_keyframe_ + newest - recalled_count_);
  const Pose2 T_map_vehicle = T_map_odom_ * keyframe.T_odom_vehicle;
  if (newest > recalled_count_) {
    const Pose2 step = keyframes_.back().T_odom_vehicle.inverse() * keyframe.T_odom_vehicle;
    graph_.odometry.push_back({newest - 1, newest, step, information_of(keyframe.covariance_since_previous)});
  } else if (newest > 0) {
    graph_.odometry.push_back(link_to(T_map_vehicle));
  }
  graph_.poses_map.push_back(T_map_vehicle);
  // The earlier drive counts as left behind.
  const double before_m =
      recalled_count_ == 0 ? 0 : graph_.travelled_m[recalled_count_ - 1] + config_.close_loop.min_gap_m;
  graph_.travelled_m.push_back(before_m + keyframe.travelled_m);
  keyframes_.push_back(
      {keyframe.time, keyframe.T_odom_vehicle, PackedLines(keyframe.lvm), PackedLines(keyframe.structure)});
  trajectory_.push_back({keyframe.time, T_map_vehicle});
  ++report_.keyframe_count;
  change_ = MapChange{};
  change_.time = keyframe.time;
  change_.T_map_odom = T_map_odom_;
}

/// From the last keyframe of the earlier drive to the first of this one: nothing was measured.
PoseEdge BackEnd::link_to(const Pose2& T_map_vehicle) const {
  const std::size_t last = recalled_count_ - 1;
  const PoseCovariance anywhere = Eigen::Vector3d(square(kAnywhere_m), square(kAnywhere_m), 1).asDiagonal();
  return {last, recalled_count_, graph_.poses_map[last].inverse() * T_map_vehicle, information_of(anywhere)};
}

/// Puts the new drive where loops to the earlier one say that it is.
void BackEnd::find_itself() {
  const std::vector<PoseEdge> loops = self_finder_->run(loop_closer_, graph_, keyframes_);
  report_.searched_m = self_finder_->searched_m();
  if (loops.empty()) return;
  const PoseEdge& loop = *std::ranges::find_if(loops, [](const PoseEdge& edge) { return is_full(edge); });
  const Pose2 move = graph_.poses_map[loop.from] * loop.T_from_to * graph_.poses_map[loop.to].inverse();
  for (std::size_t k = recalled_count_; k < graph_.poses_map.size(); ++k) {
    graph_.poses_map[k] = move * graph_.poses_map[k];
  }
  graph_.odometry[recalled_count_ - 1] = link_to(graph_.poses_map[recalled_count_]);
  for (const PoseEdge& edge : loops) graph_.loops.push_back({edge, true});
  loop_closer_.found_itself();
  follow_poses(recalled_count_);
  optimise(false);
  self_finder_.reset();
  report_.found_itself = true;
  const Eigen::Vector2d here = graph_.poses_map.back().translation();
  for (std::size_t k = 0; k < recalled_count_; ++k) to_recall_.push_back(k);
  std::ranges::stable_sort(to_recall_, std::greater{},
                           [&](std::size_t k) { return (graph_.poses_map[k].translation() - here).norm(); });
}

/// Lines of the earlier drive into the map, of so many keyframes.
void BackEnd::recall_lines(std::size_t most) {
  for (std::size_t i = std::min(most, to_recall_.size()); i > 0; --i) {
    const std::size_t k = to_recall_.back();
    to_recall_.pop_back();
    mapped_poses_[k] = graph_.poses_map[k];
    concatenate(k);
  }
}

/// Solves when a new loop says something the poses do not say already; else it waits for the next that does.
void BackEnd::optimise_for(std::span<const PoseEdge> loops) {
  bool news = false;
  for (const PoseEdge& edge : loops) {
    graph_.loops.push_back({edge, true});
    news = news || edge_error_sigma(graph_, edge) > config_.optimise.min_error_sigma;
  }
  unsolved_loops_ = unsolved_loops_ || !loops.empty();
  if (news) optimise(false);
  report_.loops = loop_closer_.report();
}

void BackEnd::optimise(bool whole) {
  const std::size_t first = whole ? 1 : first_to_move();
  const OptimiseReport solved = optimiser_.run(graph_, first);
  unsolved_loops_ = false;
  last_closure_m_ = graph_.travelled_m.back();
  if (first <= 1) last_whole_m_ = last_closure_m_;
  ++report_.optimise_count;
  report_.solved_node_count += solved.node_count;
  report_.failed_optimise_count += solved.solved ? 0 : 1;
  report_.loops_switched_off_count = solved.switched_off_count;
  if (solved.solved) follow_poses(first);
}

/// A new loop tells of the drift since the one before it: what lies long before that stays, until enough was driven for
/// another look at the whole. So the work per metre does not grow with the drive.
std::size_t BackEnd::first_to_move() const {
  const OptimiseConfig& c = config_.optimise;
  const double here_m = graph_.travelled_m.back();
  const double node_count = here_m / c.node_spacing_m + 2.0 * static_cast<double>(graph_.loops.size());
  if (here_m - last_whole_m_ >= c.whole_m_per_node * node_count) return 1;
  const double from_m = std::min(last_closure_m_, here_m - c.window_m) - c.window_m;
  const auto first = std::ranges::upper_bound(graph_.travelled_m, from_m);
  return std::max<std::size_t>(1, static_cast<std::size_t>(first - graph_.travelled_m.begin()));
}

void BackEnd::follow_poses(std::size_t first) {
  loop_closer_.poses_changed(graph_, first);
  for (std::size_t k = std::max(first, recalled_count_); k < graph_.poses_map.size(); ++k) {
    trajectory_[k - recalled_count_].T_map_vehicle = graph_.poses_map[k];
  }
  first_lagging_ = std::min(first_lagging_, first);
  map_lag_m_ = 0;
  for (std::size_t k = first_lagging_; k < mapped_poses_.size(); ++k) {
    if (mapped_poses_[k]) map_lag_m_ = std::max(map_lag_m_, shift_m(*mapped_poses_[k], graph_.poses_map[k]));
  }
  const Pose2 corrected = graph_.poses_map.back() * keyframes_.back().T_odom_vehicle.inverse();
  const Pose2& here_odom = keyframes_.back().T_odom_vehicle;
  change_.closed_loop = change_.closed_loop || shift_m(T_map_odom_ * here_odom, corrected * here_odom) > kJump_m;
  T_map_odom_ = corrected;
  change_.T_map_odom = corrected;
}

/// Whether the map must be derived again now.
bool BackEnd::due_again() const {
  const bool waited = graph_.travelled_m.back() - last_rederived_m_ >= config_.optimise.rederive_every_m;
  return map_lag_m_ > (waited ? config_.optimise.rederive_shift_m : config_.optimise.rederive_now_m);
}

/// Takes what moved keyframes show out of the map and puts it where they now are.
void BackEnd::rederive() {
  std::set<std::uint64_t> moved;
  for (std::size_t k = first_lagging_; k < mapped_poses_.size(); ++k) {
    if (!mapped_poses_[k]) continue;
    if (shift_m(*mapped_poses_[k], graph_.poses_map[k]) <= kMovedShare * config_.optimise.rederive_shift_m) continue;
    moved.insert(k);
    unpack(k);
    concatenator_.withdraw(k, lvm_, *mapped_poses_[k]);
  }
  std::set<std::uint64_t> again = concatenator_.forget();
  again.insert(moved.begin(), moved.end());
  for (const std::uint64_t k : again) {
    if (moved.contains(k)) mapped_poses_[k] = graph_.poses_map[k];
    concatenate(k);
  }
  concatenator_.end_withdrawal();
  ++report_.rederive_count;
  report_.rederived_keyframe_count += again.size();
  last_rederived_m_ = graph_.travelled_m.back();
  first_lagging_ = mapped_poses_.size();
  map_lag_m_ = 0;
}

void BackEnd::unpack(std::size_t keyframe) {
  lvm_.clear();
  keyframes_[keyframe].lvm.append_to(lvm_);
}

void BackEnd::concatenate(std::size_t keyframe) {
  unpack(keyframe);
  concatenator_.add(keyframe, keyframes_[keyframe].time, lvm_, mapped_poses_[keyframe].value());
}

void BackEnd::count_changes() {
  const auto forget = [&](LineId id) {
    const LineSize size = std::exchange(line_sizes_[id], {});
    report_.vertex_count -= size.vertex_count;
    report_.map_length_m -= size.length_m;
  };
  for (const LineId id : change_.removed) {
    forget(id);
    line_sizes_.erase(id);
  }
  for (const LineId id : change_.upserted) {
    forget(id);
    const std::vector<Vertex>& vertices = map().at(id).vertices;
    LineSize& size = line_sizes_[id];
    size.vertex_count = vertices.size();
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      size.length_m += (vertices[i].position() - vertices[i - 1].position()).norm();
    }
    report_.vertex_count += size.vertex_count;
    report_.map_length_m += size.length_m;
  }
  report_.line_count = map().size();
}

}  // namespace roadvec
