#include "core/pipeline/back_end.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/ensure.h"

namespace roadvec {
namespace {

// Below this a correction is rounding, not a jump that clients must be told of.
constexpr double kJump_m = 1e-4;
constexpr double kJumpLeverage_m = 20.0;  // a turn counts at the distance of the lines it moves

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

BackEnd::BackEnd(const PipelineConfig& config, const Pose2& T_map_odom_start, StepProbe& probe)
    : config_(config),
      probe_(probe),
      loop_closer_(config.close_loop, config.match),
      optimiser_(config.optimise),
      concatenator_(config.concatenate),
      T_map_odom_(T_map_odom_start) {}

const MapChange& BackEnd::add(const Keyframe& keyframe) {
  probe_.begin();
  take(keyframe);
  const std::vector<PoseEdge>& loops = loop_closer_.run(graph_, keyframes_);  // 7 close_loop
  probe_.done(Step::close_loop);

  optimise_for(loops);  // 8 optimise
  probe_.done(Step::optimise);

  // 9 concatenate: the newest keyframe, or all of them where they now are
  if (due_again()) {
    concatenate();
  } else {
    concatenate(keyframes_.size() - 1);
  }
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
  if (unsolved_loops_) optimise();
  probe_.done(Step::optimise);
  if (map_lag_m() > config_.optimise.rederive_shift_m) concatenate();
  concatenator_.publish(true, change_);
  probe_.done(Step::concatenate);
  count_changes();
  return change_;
}

void BackEnd::take(const Keyframe& keyframe) {
  ENSURE(keyframe.index == keyframes_.size());
  const Pose2 T_map_vehicle = T_map_odom_ * keyframe.T_odom_vehicle;
  if (!keyframes_.empty()) {
    const Pose2 step = keyframes_.back().T_odom_vehicle.inverse() * keyframe.T_odom_vehicle;
    graph_.odometry.push_back(
        {keyframes_.size() - 1, keyframes_.size(), step, information_of(keyframe.covariance_since_previous)});
  }
  graph_.poses_map.push_back(T_map_vehicle);
  graph_.travelled_m.push_back(keyframe.travelled_m);
  keyframes_.push_back(
      {keyframe.time, keyframe.T_odom_vehicle, PackedLines(keyframe.lvm), PackedLines(keyframe.structure)});
  trajectory_.push_back({keyframe.time, T_map_vehicle});
  ++report_.keyframe_count;
  change_ = MapChange{};
  change_.time = keyframe.time;
  change_.T_map_odom = T_map_odom_;
}

/// Solves when a new loop says something the poses do not say already; else it waits for the next that does.
void BackEnd::optimise_for(std::span<const PoseEdge> loops) {
  bool news = false;
  for (const PoseEdge& edge : loops) {
    graph_.loops.push_back({edge, true});
    news = news || edge_error_sigma(graph_, edge) > config_.optimise.min_error_sigma;
  }
  unsolved_loops_ = unsolved_loops_ || !loops.empty();
  if (news) optimise();
  report_.loops = loop_closer_.report();
}

void BackEnd::optimise() {
  const OptimiseReport solved = optimiser_.run(graph_);
  unsolved_loops_ = false;
  ++report_.optimise_count;
  report_.failed_optimise_count += solved.solved ? 0 : 1;
  report_.loops_switched_off_count = solved.switched_off_count;
  if (solved.solved) follow_poses();
}

void BackEnd::follow_poses() {
  poses_moved_ = true;
  loop_closer_.poses_changed(graph_);
  for (std::size_t k = 0; k < trajectory_.size(); ++k) trajectory_[k].T_map_vehicle = graph_.poses_map[k];
  const Pose2 corrected = graph_.poses_map.back() * keyframes_.back().T_odom_vehicle.inverse();
  const Pose2& here_odom = keyframes_.back().T_odom_vehicle;
  change_.closed_loop = change_.closed_loop || shift_m(T_map_odom_ * here_odom, corrected * here_odom) > kJump_m;
  T_map_odom_ = corrected;
  change_.T_map_odom = corrected;
}

/// Whether the map must be derived again now.
bool BackEnd::due_again() const {
  if (!poses_moved_) return false;
  const bool waited = graph_.travelled_m.back() - last_rederived_m_ >= config_.optimise.rederive_every_m;
  return map_lag_m() > (waited ? config_.optimise.rederive_shift_m : config_.optimise.rederive_now_m);
}

/// How far, at most, a keyframe's lines lie in the map from where its pose now is.
double BackEnd::map_lag_m() const {
  double greatest_m = 0;
  for (std::size_t k = 0; k < mapped_poses_.size(); ++k) {
    greatest_m = std::max(greatest_m, shift_m(mapped_poses_[k], graph_.poses_map[k]));
  }
  return greatest_m;
}

void BackEnd::concatenate() {
  concatenator_.restart();
  mapped_poses_.clear();
  for (std::size_t k = 0; k < keyframes_.size(); ++k) concatenate(k);
  ++report_.rederive_count;
  last_rederived_m_ = graph_.travelled_m.back();
  poses_moved_ = false;
}

void BackEnd::concatenate(std::size_t keyframe) {
  lvm_.clear();
  keyframes_[keyframe].lvm.append_to(lvm_);
  concatenator_.add(keyframe, keyframes_[keyframe].time, lvm_, graph_.poses_map[keyframe]);
  mapped_poses_.push_back(graph_.poses_map[keyframe]);
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
