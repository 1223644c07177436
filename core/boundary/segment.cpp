#include "core/boundary/segment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace roadvec {
namespace {

constexpr float kNothing_m = std::numeric_limits<float>::max();
constexpr std::size_t kSlices = 128;             // of a sweep: 0.8 ms each, 1 cm of driving at 13 m/s
constexpr float kLowest_m = -5, kHighest_m = 8;  // heights that a street can have within the window

/// p_window = rows * (p_lidar, 1) for one instant of the sweep; z is the height above the vehicle's ground plane.
using SliceTransform = Eigen::Matrix<float, 3, 4>;

}  // namespace

LidarMounting mounting_from(const Eigen::Vector3d& translation_m, double roll_rad, double pitch_rad, double yaw_rad) {
  const Eigen::AngleAxisd yaw(yaw_rad, Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd pitch(pitch_rad, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd roll(roll_rad, Eigen::Vector3d::UnitX());
  return {(yaw * pitch * roll).toRotationMatrix(), translation_m};
}

Segmenter::Segmenter(const SegmentConfig& config, const WindowConfig& window, const LidarMounting& mounting,
                     std::size_t max_returns)
    : config_(config),
      window_(window),
      mounting_(mounting),
      cells_(window_.cell_count(), kEmptyCell),
      stride_(static_cast<std::size_t>(window_.size() + 2 * kReach)),
      spans_(stride_ * stride_, kNoReturns),
      coarse_size_((window_.size() + kCoarseCells - 1) / kCoarseCells),
      result_(window) {
  points_.reserve(max_returns);
  touched_.reserve(window_.cell_count());
  tallies_.reserve(window_.cell_count() / 4);
  coarse_lowest_m_.resize(static_cast<std::size_t>(coarse_size_ * coarse_size_));
  street_m_.resize(coarse_lowest_m_.size());
}

const Segmentation& Segmenter::run(const Sweep& sweep, const Path& path_odom) noexcept {
  for (const std::int32_t i : touched_) {
    cells_[static_cast<std::size_t>(i)] = kEmptyCell;
    spans_[corner(i % window_.size() + kReach, i / window_.size() + kReach)] = kNoReturns;
    result_.seen[static_cast<std::size_t>(i)] = 0;
  }
  touched_.clear();
  tallies_.clear();
  points_.clear();
  std::fill(coarse_lowest_m_.begin(), coarse_lowest_m_.end(), kNothing_m);
  window_.centre_on(path_odom.empty() ? Eigen::Vector2d::Zero() : path_odom.end().T_odom_vehicle.translation());
  result_.boundary.restart(window_);
  result_.structure.restart(window_);

  place(sweep, path_odom);
  find_road();
  tally_obstacles();
  report();
  return result_;
}

void Segmenter::place(const Sweep& sweep, const Path& path_odom) noexcept {
  const std::int64_t span_ns = std::max<std::int64_t>(sweep.end - sweep.start, 1);
  std::array<SliceTransform, kSlices> transforms;
  const Eigen::Vector2d origin = window_.origin_odom();
  for (std::size_t k = 0; k < kSlices; ++k) {
    const auto middle_ns =
        static_cast<std::int64_t>((static_cast<double>(k) + 0.5) * static_cast<double>(span_ns) / kSlices);
    const Pose2 pose = path_odom.at(sweep.start + middle_ns);
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(pose.theta_rad).toRotationMatrix();
    Eigen::Vector3d shift = turn * mounting_.translation_m;
    shift.head<2>() += pose.translation() - origin;
    transforms[k].leftCols<3>() = (turn * mounting_.rotation).cast<float>();
    transforms[k].col(3) = shift.cast<float>();
  }
  const auto cells_per_m = static_cast<float>(1.0 / window_.cell_m());
  const int size = window_.size();
  const Eigen::Matrix3f to_vehicle = mounting_.rotation.cast<float>();
  const Eigen::Vector3f shift_vehicle = mounting_.translation_m.cast<float>();
  const auto ahead = static_cast<float>(config_.body_ahead_m), behind = static_cast<float>(-config_.body_behind_m),
             side = static_cast<float>(config_.body_side_m);
  const float body_reach2_m2 = (ahead + 2) * (ahead + 2);
  const float slice_per_ns = static_cast<float>(kSlices) / static_cast<float>(span_ns);
  for (const Return& echo : sweep.returns) {
    if (points_.size() == points_.capacity()) break;
    const Eigen::Vector3f p_lidar(echo.x_m, echo.y_m, echo.z_m);
    if (p_lidar.head<2>().squaredNorm() < body_reach2_m2) {
      const Eigen::Vector3f p = to_vehicle * p_lidar + shift_vehicle;
      if (p.x() < ahead && p.x() > behind && std::abs(p.y()) < side) continue;
    }
    const auto slice = std::min(static_cast<std::size_t>(static_cast<float>(echo.time_ns) * slice_per_ns), kSlices - 1);
    const SliceTransform& T = transforms[slice];
    const Eigen::Vector3f p = T.leftCols<3>() * p_lidar + T.col(3);
    const float column = p.x() * cells_per_m, row = p.y() * cells_per_m;
    if (!(column >= 0 && row >= 0 && column < static_cast<float>(size) && row < static_cast<float>(size))) continue;
    if (!(p.z() > kLowest_m && p.z() < kHighest_m)) continue;
    const int c = static_cast<int>(column), r = static_cast<int>(row);
    const int index = window_.index(c, r);
    Span& span = spans_[corner(c + kReach, r + kReach)];
    if (span.lowest_m == kNothing_m) touched_.push_back(index);
    span.lowest_m = std::min(span.lowest_m, p.z());
    span.highest_m = std::max(span.highest_m, p.z());
    points_.push_back({p.x(), p.y(), p.z(), index});
  }
  result_.return_count = points_.size();
}

float Segmenter::lowest_nearby(int column, int row) const noexcept {
  float lowest = kNothing_m;
  for (int dr = 0; dr <= 2 * kReach; ++dr) {
    const Span* spans = &spans_[corner(column, row + dr)];
    for (int dc = 0; dc <= 2 * kReach; ++dc) lowest = std::min(lowest, spans[dc].lowest_m);
  }
  return lowest;
}

/// Mean of the lowest cells within kReach, each lifted by what the allowed slope explains over its distance.
float Segmenter::road_height(int column, int row) const noexcept {
  std::array<float, 10> lowest;
  const int wanted = std::min(config_.lowest_count, static_cast<int>(lowest.size()));
  int count = 0;
  const auto slope_per_cell = static_cast<float>(config_.slope * window_.cell_m());
  for (int dr = -kReach; dr <= kReach; ++dr) {
    const Span* spans = &spans_[corner(column + kReach, row + kReach + dr)];
    for (int dc = -kReach; dc <= kReach; ++dc) {
      if (spans[dc].lowest_m == kNothing_m) continue;
      float height = spans[dc].lowest_m + slope_per_cell * static_cast<float>(std::max(std::abs(dc), std::abs(dr)));
      for (int k = 0; k < count; ++k) {
        if (height < lowest[static_cast<std::size_t>(k)]) std::swap(height, lowest[static_cast<std::size_t>(k)]);
      }
      if (count < wanted) lowest[static_cast<std::size_t>(count++)] = height;
    }
  }
  float sum = 0;
  for (int k = 0; k < count; ++k) sum += lowest[static_cast<std::size_t>(k)];
  return count > 0 ? sum / static_cast<float>(count) : 0;
}

/// Lowest return of each coarse cell and its neighbours: the street itself, even where a cell holds only a roof or a
/// branch.
void Segmenter::find_streets() noexcept {
  for (const std::int32_t index : touched_) {
    const int column = index % window_.size(), row = index / window_.size();
    float& coarse =
        coarse_lowest_m_[static_cast<std::size_t>((row / kCoarseCells) * coarse_size_ + column / kCoarseCells)];
    coarse = std::min(coarse, spans_[corner(column + kReach, row + kReach)].lowest_m);
  }
  for (int row = 0; row < coarse_size_; ++row) {
    for (int column = 0; column < coarse_size_; ++column) {
      float lowest = kNothing_m;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, coarse_size_ - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, coarse_size_ - 1); ++c) {
          lowest = std::min(lowest, coarse_lowest_m_[static_cast<std::size_t>(r * coarse_size_ + c)]);
        }
      }
      street_m_[static_cast<std::size_t>(row * coarse_size_ + column)] = lowest;
    }
  }
}

void Segmenter::find_road() noexcept {
  find_streets();
  const auto step = static_cast<float>(config_.step_m), structure = static_cast<float>(config_.structure_step_m);
  const auto under = static_cast<float>(config_.span_m);
  for (const std::int32_t index : touched_) {
    const int column = index % window_.size(), row = index / window_.size();
    Cell& cell = cells_[static_cast<std::size_t>(index)];
    const float street_m =
        street_m_[static_cast<std::size_t>((row / kCoarseCells) * coarse_size_ + column / kCoarseCells)];
    cell.limit_m = street_m + under;
    cell.structure_m = street_m + structure;
    const Span& span = spans_[corner(column + kReach, row + kReach)];
    result_.seen[static_cast<std::size_t>(index)] = span.lowest_m < cell.limit_m;
    // The road's height is worth its cost only where something could stand above it.
    const float least_step_m = lowest_nearby(column, row) + step;
    if (span.highest_m <= std::min(least_step_m, cell.structure_m)) {
      cell.step_m = cell.structure_m = kNothing_m;
      continue;
    }
    cell.road_m = road_height(column, row);
    cell.step_m = cell.road_m + step;
  }
}

void Segmenter::tally_obstacles() noexcept {
  for (const Point& p : points_) {
    Cell& cell = cells_[static_cast<std::size_t>(p.cell)];
    const bool tall = p.z_m > cell.structure_m;
    if ((p.z_m <= cell.step_m && !tall) || p.z_m >= cell.limit_m) continue;
    if (cell.tally < 0) {
      if (tallies_.size() == tallies_.capacity()) continue;
      cell.tally = static_cast<std::int32_t>(tallies_.size());
      tallies_.push_back({.cell = p.cell, .x0_m = p.x_m, .y0_m = p.y_m, .boundary = {}, .structure = {}});
    }
    Tally& tally = tallies_[static_cast<std::size_t>(cell.tally)];
    tally.boundary.add(p.x_m - tally.x0_m, p.y_m - tally.y0_m);
    if (tall) tally.structure.add(p.x_m - tally.x0_m, p.y_m - tally.y0_m);
    tally.top_m = std::max(tally.top_m, p.z_m);
  }
}

void Segmenter::Moments::add(float x, float y) noexcept {
  count += 1;
  x_m += x;
  y_m += y;
  xx_m2 += x * x;
  yy_m2 += y * y;
}

BoundaryCell Segmenter::cell_of(const Tally& tally, const Moments& moments) const noexcept {
  const auto n = static_cast<float>(moments.count);
  const float x = moments.x_m / n, y = moments.y_m / n;
  const float variance = std::max(0.0F, 0.5F * (moments.xx_m2 / n - x * x + moments.yy_m2 / n - y * y));
  const float road = std::min(cells_[static_cast<std::size_t>(tally.cell)].road_m, tally.top_m);
  return {tally.x0_m + x, tally.y0_m + y, road, tally.top_m - road, std::sqrt(variance), 1.0F, moments.count};
}

void Segmenter::report() noexcept {
  const auto enough = static_cast<std::uint32_t>(config_.return_count);
  for (const Tally& tally : tallies_) {
    if (tally.boundary.count >= enough) result_.boundary.add(tally.cell, cell_of(tally, tally.boundary));
    if (tally.structure.count >= enough) result_.structure.add(tally.cell, cell_of(tally, tally.structure));
  }
}

}  // namespace roadvec
