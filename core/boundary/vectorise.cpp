#include "core/boundary/vectorise.h"

#include <algorithm>
#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

constexpr double kOcclusionStep_m = 0.5;  // nearer by more than this: what is nearer hides what follows
constexpr float kCellSigma_m = 0.06F;     // of a single return in a cell of 0.2 m: its edge over the root of twelve

constexpr std::size_t kMostRays = 7200;  // virtual_scan.ray_count

double distance_m(const BoundaryCell& a, const BoundaryCell& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

}  // namespace

Vectoriser::Vectoriser(const VectoriseConfig& config) : config_(config) {
  hits_.reserve(kMostRays);
  heights_m_.reserve(kMostRays);
  lines_.reserve(kMostRays, kMostRays / 2);
}

/// Hits in order of their rays; rays that hit the same cell are one hit. Starts after a break, so that no line is cut
/// by ray 0.
void Vectoriser::collect(const VirtualScan& scan) noexcept {
  hits_.clear();
  const std::size_t count = scan.rays.size();
  std::size_t start = 0;
  while (start < count && scan.rays[start].slot >= 0) ++start;
  start %= count;
  for (std::size_t k = 0; k < count; ++k) {
    const VirtualScan::Ray& ray = scan.rays[(start + k) % count];
    if (ray.slot < 0) continue;
    const BoundaryCell* cell = &scan.cells->cells()[static_cast<std::size_t>(ray.slot)];
    // A cell seen again on the other side of a nearer one adds nothing but a step back.
    const bool again =
        !hits_.empty() && (hits_.back().cell == cell || (hits_.size() > 1 && hits_[hits_.size() - 2].cell == cell));
    if (again) {
      hits_.back().last_ray = k;
    } else {
      hits_.push_back({cell, k, k, ray.range_m});
    }
  }
}

bool Vectoriser::connected(const Hit& a, const Hit& b, std::size_t ray_count) const noexcept {
  const double gap_m = distance_m(*a.cell, *b.cell);
  if (gap_m <= config_.near_gap_m) return true;
  if (gap_m > config_.far_gap_m) return false;
  // Hits of one straight line, n rays apart, at range r, met at angle alpha: gap = r * n * ray_step / sin(alpha).
  const double ray_step_rad = kTwoPi / static_cast<double>(ray_count);
  const double arc_m = std::min(a.range_m, b.range_m) * static_cast<double>(b.first_ray - a.last_ray) * ray_step_rad;
  return arc_m >= gap_m * std::sin(config_.least_incidence_rad);
}

EndKind Vectoriser::end_between(const Hit& here, const Hit& other, std::size_t rays_apart,
                                double range_m) const noexcept {
  if (here.range_m > range_m - config_.far_gap_m) return EndKind::unseen;
  if (rays_apart > 1) return EndKind::open;
  return other.range_m < here.range_m - kOcclusionStep_m ? EndKind::occluded : EndKind::open;
}

void Vectoriser::emit(std::size_t first, std::size_t last, const VirtualScan& scan, const Pose2& T_out_odom) noexcept {
  if (last - first + 1 < static_cast<std::size_t>(config_.vertex_count)) return;
  double extent_m = 0;  // not from end to end: a yard's outline closes on itself
  for (std::size_t i = first; i <= last; ++i)
    extent_m = std::max(extent_m, distance_m(*hits_[first].cell, *hits_[i].cell));
  if (extent_m < config_.length_m) return;
  heights_m_.clear();
  float existence = 0;
  std::uint32_t observation_count = 0;
  for (std::size_t i = first; i <= last; ++i) {
    heights_m_.push_back(hits_[i].cell->height_m);
    existence += hits_[i].cell->existence;
    observation_count = std::max(observation_count, hits_[i].cell->count);
  }
  const auto middle = heights_m_.begin() + static_cast<std::ptrdiff_t>(heights_m_.size() / 2);
  std::nth_element(heights_m_.begin(), middle, heights_m_.end());

  const std::size_t count = hits_.size();
  const Hit &before = hits_[(first + count - 1) % count], &after = hits_[(last + 1) % count];
  const std::size_t rays = scan.rays.size();
  LineAttributes attributes;
  attributes.height_m = *middle;
  attributes.kind = *middle < static_cast<float>(config_.curb_height_m) ? BoundaryKind::curb : BoundaryKind::barrier;
  attributes.existence = existence / static_cast<float>(last - first + 1);
  attributes.observation_count = observation_count;
  const double range_m = scan.cells->window().half() * scan.cells->window().cell_m();
  attributes.first_end =
      end_between(hits_[first], before, (hits_[first].first_ray + rays - before.last_ray) % rays, range_m);
  attributes.last_end =
      end_between(hits_[last], after, (after.first_ray + rays - hits_[last].last_ray) % rays, range_m);

  lines_.begin_line(attributes);
  const Eigen::Vector2d origin_odom = scan.cells->window().origin_odom();
  for (std::size_t i = first; i <= last; ++i) {
    ray_count_ += hits_[i].last_ray - hits_[i].first_ray + 1;
    const BoundaryCell& cell = *hits_[i].cell;
    const Eigen::Vector2d p = T_out_odom * (origin_odom + Eigen::Vector2d(cell.x_m, cell.y_m));
    const float sigma_m =
        std::max(cell.sigma_m, kCellSigma_m) / std::sqrt(static_cast<float>(std::max(cell.count, 1U)));
    lines_.push_vertex({p.x(), p.y(), cell.ground_m, cell.height_m, sigma_m, sigma_m});
  }
}

const LineSet& Vectoriser::run(const VirtualScan& scan, const Pose2& T_out_odom) noexcept {
  lines_.clear();
  ray_count_ = 0;
  collect(scan);
  for (std::size_t first = 0; first < hits_.size();) {
    std::size_t last = first;
    while (last + 1 < hits_.size() && connected(hits_[last], hits_[last + 1], scan.rays.size())) ++last;
    emit(first, last, scan, T_out_odom);
    first = last + 1;
  }
  return lines_;
}

}  // namespace roadvec
