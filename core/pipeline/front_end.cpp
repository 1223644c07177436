#include "core/pipeline/front_end.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

namespace roadvec {
namespace {

constexpr std::size_t kVertexReserve = 16384, kLineReserve = 2048;  // a window holds 160 000 cells, a scan 1440 hits

Vertex moved(Vertex vertex, const Pose2& T) {
  const Eigen::Vector2d p = T * vertex.position();
  vertex.x_m = p.x();
  vertex.y_m = p.y();
  return vertex;
}

/// The point at share u of the way from a to b; exact at both ends.
Vertex between(const Vertex& a, const Vertex& b, double u) {
  if (u == 0) return a;
  if (u == 1) return b;
  Vertex vertex = u < 0.5 ? a : b;
  vertex.x_m = a.x_m + u * (b.x_m - a.x_m);
  vertex.y_m = a.y_m + u * (b.y_m - a.y_m);
  return vertex;
}

/// Shares of the way from a to b between which it lies within `radius_m` of the origin; {1, 0} when nowhere.
std::pair<double, double> within_circle(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double radius_m) {
  // |a + u (b - a)|^2 = r^2
  const Eigen::Vector2d d = b - a;
  const double A = d.squaredNorm(), B = a.dot(d), C = a.squaredNorm() - radius_m * radius_m;
  if (A == 0) return C <= 0 ? std::pair(0.0, 1.0) : std::pair(1.0, 0.0);
  const double discriminant = B * B - A * C;
  if (discriminant <= 0) return {1.0, 0.0};
  const double root = std::sqrt(discriminant);
  return {std::max(0.0, (-B - root) / A), std::min(1.0, (-B + root) / A)};
}

}  // namespace

FrontEnd::FrontEnd(const PipelineConfig& config, const FrontEndSetup& setup, StepProbe& probe)
    : config_(config),
      probe_(probe),
      odometry_(config.odometry, setup.vehicle),
      segmenter_(config.segment, config.window, setup.lidar, setup.max_returns_per_sweep),
      sweep_boundary_scanner_(config.virtual_scan),
      sweep_structure_scanner_(config.virtual_scan),
      boundary_scanner_(config.virtual_scan),
      structure_scanner_(config.virtual_scan),
      boundary_grid_(config.fuse, config.window, FreeSpace::where_seen),
      structure_grid_(config.fuse, config.window, FreeSpace::where_passed),
      sweep_vectoriser_(config.vectorise),
      boundary_vectoriser_(config.vectorise),
      structure_vectoriser_(config.vectorise),
      boundary_simplifier_(config.simplify),
      structure_simplifier_(config.simplify),
      matcher_(config.match),
      mounting_(setup.lidar) {
  sweep_lines_.reserve(kVertexReserve, kLineReserve);
  local_map_odom_.reserve(kVertexReserve, kLineReserve);
  raw_lvm_ = lvm_ = structure_ = &local_map_odom_;
}

Keyframe* FrontEnd::add(const Sweep& sweep, std::span<const MotionSample> motion, Keyframe* slot) noexcept {
  probe_.begin();
  const Path& path_odom = odometry_.integrate(motion, sweep.start, sweep.end);  // 0 odometry
  const Pose2 predicted = odometry_.pose();
  probe_.done(Step::odometry);

  const Segmentation& obstacles = segmenter_.run(sweep, path_odom);  // 1 segment
  probe_.done(Step::segment);

  const Eigen::Vector2d eye_odom = predicted * Eigen::Vector2d(mounting_.translation_m.head<2>());
  const VirtualScan& boundary = sweep_boundary_scanner_.run(obstacles.boundary, eye_odom);  // 2 virtual scan
  const VirtualScan& structure = sweep_structure_scanner_.run(obstacles.structure, eye_odom);
  probe_.done(Step::virtual_scan);

  // Differs from the paper: step 6 comes before step 3, sweep against local map, because a sweep fused where the
  // odometry alone puts it blurs the very grid that it would be matched with.
  match_sweep(structure, boundary);  // 6 match, or the prediction
  const Pose2 corrected = odometry_.pose();
  const Pose2 correction = corrected * predicted.inverse();
  probe_.done(Step::match);

  boundary_grid_.fuse(boundary, sweep_boundary_scanner_, obstacles.seen, correction);  // 3 fuse
  structure_grid_.fuse(structure, sweep_structure_scanner_, obstacles.seen, correction);
  probe_.done(Step::fuse);

  const Eigen::Vector2d seat_odom = correction * eye_odom;
  raw_lvm_ =
      &boundary_vectoriser_.run(boundary_scanner_.run(boundary_grid_.cells(), seat_odom), Pose2{});  // 4 vectorise
  const LineSet& raw_structure =
      structure_vectoriser_.run(structure_scanner_.run(structure_grid_.cells(), seat_odom), Pose2{});
  probe_.done(Step::vectorise);

  lvm_ = &boundary_simplifier_.run_all(*raw_lvm_);  // 5 simplify
  structure_ = &structure_simplifier_.run_all(raw_structure);
  probe_.done(Step::simplify);

  report_.sweep_count += 1;
  report_.travelled_m += (last_pose_.inverse() * corrected).translation().norm();
  last_pose_ = corrected;
  Keyframe* const keyframe = take_keyframe(slot);
  if (keyframe != nullptr) keyframe->received_ns = sweep.received_ns;
  return keyframe;
}

void FrontEnd::coast(std::span<const MotionSample> motion) noexcept {
  if (motion.empty()) return;
  odometry_.integrate(motion, odometry_.time(), std::max(odometry_.time(), motion.back().time));
  report_.travelled_m += (last_pose_.inverse() * odometry_.pose()).translation().norm();
  last_pose_ = odometry_.pose();
}

void FrontEnd::match_sweep(const VirtualScan& structure, const VirtualScan& boundary) noexcept {
  const Pose2 predicted = odometry_.pose();
  const Pose2 T_vehicle_odom = predicted.inverse();
  sweep_lines_.clear();
  sweep_lines_.append(sweep_vectoriser_.run(structure, T_vehicle_odom));
  sweep_lines_.append(sweep_vectoriser_.run(boundary, T_vehicle_odom));
  local_map_odom_.clear();
  if (structure_ != &local_map_odom_) {
    local_map_odom_.append(*structure_);
    local_map_odom_.append(*lvm_);
  }
  matcher_.set_reference(local_map_odom_);
  match_ = matcher_.run(sweep_lines_, predicted, odometry_.pose_covariance());
  if (match_.usable()) {
    // The match is lines and prediction together, and the filter holds the prediction already: give it the lines alone,
    // L (x_lines - x) = (L + P^-1) (x_match - x).
    const Eigen::Vector3d moved(match_.pose.x_m - predicted.x_m, match_.pose.y_m - predicted.y_m,
                                wrap_rad(match_.pose.theta_rad - predicted.theta_rad));
    const Eigen::Matrix3d prior_information = odometry_.pose_covariance().ldlt().solve(Eigen::Matrix3d::Identity());
    odometry_.correct((match_.information + prior_information) * moved, match_.information);
    ++report_.match_accepted_count;
  } else {
    ++report_.match_rejected_count;
  }
}

Keyframe* FrontEnd::take_keyframe(Keyframe* slot) noexcept {
  const Pose2 pose = odometry_.pose();
  const Pose2 moved = last_keyframe_pose_.inverse() * pose;
  const bool far_enough = moved.translation().norm() >= config_.keyframe.spacing_m ||
                          std::abs(moved.theta_rad) >= config_.keyframe.spacing_rad;
  if (slot == nullptr || (has_keyframe_ && !far_enough)) return nullptr;
  slot->index = report_.keyframe_count;
  slot->time = odometry_.time();
  slot->T_odom_vehicle = pose;
  slot->covariance_since_previous = odometry_.relative_covariance();
  slot->travelled_m = report_.travelled_m;
  copy_near(*lvm_, pose.inverse(), slot->lvm);
  copy_near(*structure_, pose.inverse(), slot->structure);
  odometry_.begin_relative();
  last_keyframe_pose_ = pose;
  has_keyframe_ = true;
  ++report_.keyframe_count;
  report_.raw_ray_count += boundary_vectoriser_.ray_count();
  report_.raw_vertex_count += raw_lvm_->vertices().size();
  report_.kept_vertex_count += lvm_->vertices().size();
  return slot;
}

/// Cut at the keyframe's range: a line that leaves it and returns becomes two.
void FrontEnd::copy_near(const LineSet& lines_odom, const Pose2& T_vehicle_odom, LineSet& out) const {
  out.clear();
  for (const LineSet::Line& line : lines_odom.lines()) {
    const std::span<const Vertex> vertices = lines_odom.vertices_of(line);
    bool open = false;  // the last segment was inside up to its end
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      const Vertex a = moved(vertices[i - 1], T_vehicle_odom), b = moved(vertices[i], T_vehicle_odom);
      const auto [enter, leave] = within_circle(a.position(), b.position(), config_.keyframe.range_m);
      if (enter >= leave) {
        open = false;
        continue;
      }
      if (!open) {
        out.begin_line(line.attributes);
        if (i > 1 || enter > 0) out.lines().back().attributes.first_end = EndKind::unseen;
        out.push_vertex(between(a, b, enter));
      }
      out.push_vertex(between(a, b, leave));
      open = leave == 1;
      if (!open || i + 1 < vertices.size()) out.lines().back().attributes.last_end = EndKind::unseen;
      if (open && i + 1 == vertices.size()) out.lines().back().attributes.last_end = line.attributes.last_end;
    }
  }
}

}  // namespace roadvec
