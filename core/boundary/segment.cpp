#include "core/boundary/segment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/float4.h"

namespace roadvec {
namespace {

constexpr std::size_t kSlices = 128;             // of a sweep: 0.8 ms each, 1 cm of driving at 13 m/s
constexpr float kLowest_m = -5, kHighest_m = 8;  // heights that a street can have within the window
constexpr std::int32_t kLowest_mm = -5000;
// How far behind its edge a kerb may show first where no ring lies on the edge: about a cell. Measured: without it
// sparse scenes turn the car, because what shows far away lies farther out than what shows nearby.
constexpr float kUnseenEdge_m = 0.25F;
// Returns lower than this share of the cell's height lie on the road: the top of a kerb that leans with the sidewalk,
// or is noisy, does not reach down so far.
constexpr float kRoadShare = 0.4F;
constexpr float kOutside_m = 1e6;                                       // stands for no return
constexpr std::int16_t kHighestReal_mm = 10'000;                        // a height, with the rise that a slope explains
constexpr std::int16_t kNoLowest_mm = 16'000, kNoHighest_mm = -16'000;  // a sum of two fits 16 bits

constexpr float m_from_mm(float mm) { return 0.001F * mm; }
std::int16_t mm_from_m(double m) { return static_cast<std::int16_t>(std::lround(1000 * m)); }

using Row = std::int16_t __attribute__((vector_size(16)));  // eight neighbours in a row of cells
Row lower(Row a, Row b) { return a < b ? a : b; }
Row higher(Row a, Row b) { return a < b ? b : a; }

/// For each of eight columns its `count` lowest values, in order.
struct LowestRows {
  static constexpr std::size_t kMost = 10;
  std::array<Row, kMost> rows;
  std::size_t count;

  explicit LowestRows(std::size_t wanted) : count(wanted) { rows.fill(Row{} + kNoLowest_mm); }
  void add(Row value) {
    for (std::size_t k = 0; k < count; ++k) {
      const Row held = rows[k];
      rows[k] = lower(held, value);
      value = higher(held, value);
    }
  }
  /// Column 0 takes in the others.
  void fold() {
    const std::array<Row, kMost> held = rows;
    for (std::size_t k = 0; k < count; ++k) add(__builtin_shufflevector(held[k], held[k], 4, 5, 6, 7, 4, 5, 6, 7));
    const std::array<Row, kMost> half = rows;
    for (std::size_t k = 0; k < count; ++k) add(__builtin_shufflevector(half[k], half[k], 2, 3, 2, 3, 2, 3, 2, 3));
    const std::array<Row, kMost> quarter = rows;
    for (std::size_t k = 0; k < count; ++k)
      add(__builtin_shufflevector(quarter[k], quarter[k], 1, 1, 1, 1, 1, 1, 1, 1));
  }
};

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
      T_vehicle_lidar_{mounting.rotation.cast<float>(), mounting.translation_m.cast<float>()},
      stride_(static_cast<std::size_t>(window_.size() + 2 * kReach)),
      lowest_mm_(stride_ * stride_ + sizeof(Row) / 2, kNoLowest_mm),  // a row of neighbours is read as eight
      highest_mm_(lowest_mm_.size(), kNoHighest_mm),
      coarse_size_((window_.size() + kCoarseCells - 1) / kCoarseCells),
      coarse_lowest_mm_(static_cast<std::size_t>(coarse_size_ * coarse_size_), kNoLowest_mm),
      street_mm_(coarse_lowest_mm_.size()),
      obstacle_of_(window_.cell_count(), 0),
      obstacle_bits_(window_.cell_count() / 64 + 1, 0),
      result_(window) {
  points_.reserve(max_returns);
  touched_.reserve(window_.cell_count());
  obstacles_.reserve(window_.cell_count() / 4);
}

const Segmentation& Segmenter::run(const Sweep& sweep, const Path& path_odom) noexcept {
  forget_last_sweep();
  window_.centre_on(path_odom.empty() ? Eigen::Vector2d::Zero() : path_odom.end().T_odom_vehicle.translation());
  result_.boundary.restart(window_);
  result_.structure.restart(window_);

  place(sweep, path_odom);
  find_streets();
  find_obstacles();
  tally_obstacles();
  report();
  return result_;
}

void Segmenter::forget_last_sweep() noexcept {
  for (const Place at : touched_) {
    lowest_mm_[with_rim(at.column, at.row)] = kNoLowest_mm;
    highest_mm_[with_rim(at.column, at.row)] = kNoHighest_mm;
    result_.seen[static_cast<std::size_t>(window_.index(at.column, at.row))] = 0;
  }
  for (const Obstacle& obstacle : obstacles_) obstacle_bits_[static_cast<std::size_t>(obstacle.cell) / 64] = 0;
  std::fill(coarse_lowest_mm_.begin(), coarse_lowest_mm_.end(), kNoLowest_mm);
  touched_.clear();
  obstacles_.clear();
  points_.clear();
}

void Segmenter::place(const Sweep& sweep, const Path& path_odom) noexcept {
  const std::int64_t span_ns = std::max<std::int64_t>(sweep.end - sweep.start, 1);
  std::array<Transform, kSlices> transforms;
  const Eigen::Vector2d origin = window_.origin_odom();
  for (std::size_t k = 0; k < kSlices; ++k) {
    const auto middle_ns =
        static_cast<std::int64_t>((static_cast<double>(k) + 0.5) * static_cast<double>(span_ns) / kSlices);
    const Pose2 pose = path_odom.at(sweep.start + middle_ns);
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(pose.theta_rad).toRotationMatrix();
    Eigen::Vector3d shift = turn * mounting_.translation_m;
    shift.head<2>() += pose.translation() - origin;
    transforms[k] = {(turn * mounting_.rotation).cast<float>(), shift.cast<float>()};
  }
  const float slice_per_ns = static_cast<float>(kSlices) / static_cast<float>(span_ns);
  const std::size_t count = std::min(sweep.returns.size(), points_.capacity());
  // Four returns are microseconds apart: they share the first one's slice.
  for (std::size_t i = 0; i < count; i += 4) {
    const Return* echoes = &sweep.returns[i];
    const auto slice =
        std::min(static_cast<std::size_t>(static_cast<float>(echoes->time_ns) * slice_per_ns), kSlices - 1);
    if (i + 4 <= count) {
      place_four(echoes, transforms[slice]);
    } else {
      std::array<Return, 4> rest;
      rest.fill({.x_m = kOutside_m});
      std::copy(echoes, sweep.returns.data() + count, rest.begin());
      place_four(rest.data(), transforms[slice]);
    }
  }
  result_.return_count = points_.size();
}

void Segmenter::place_four(const Return* echoes, const Transform& T_window_lidar) noexcept {
  const Points4 p = transpose(load<Float4>(&echoes[0].x_m), load<Float4>(&echoes[1].x_m), load<Float4>(&echoes[2].x_m),
                              load<Float4>(&echoes[3].x_m));
  const auto moved = [&p](const Transform& T, int row) {
    return T.rotation(row, 0) * p.x + T.rotation(row, 1) * p.y + T.rotation(row, 2) * p.z + T.shift_m[row];
  };
  const Float4 ahead = moved(T_vehicle_lidar_, 0), left = moved(T_vehicle_lidar_, 1);
  const auto side = static_cast<float>(config_.body_side_m);
  const Int4 own_body = (ahead < static_cast<float>(config_.body_ahead_m)) &
                        (ahead > static_cast<float>(-config_.body_behind_m)) & (left < side) & (left > -side);
  const Float4 x = moved(T_window_lidar, 0), y = moved(T_window_lidar, 1), z = moved(T_window_lidar, 2);
  const auto cells_per_m = static_cast<float>(1.0 / window_.cell_m()), size = static_cast<float>(window_.size());
  const Float4 column = x * cells_per_m, row = y * cells_per_m;
  const Int4 taken = (column >= 0.0F) & (column < size) & (row >= 0.0F) & (row < size) & (z > kLowest_m) &
                     (z < kHighest_m) & ~own_body;
  // What is not taken may be any float, and is no number of cells.
  const auto whole = [&taken](Float4 value) { return __builtin_convertvector(where(taken, value), Int4); };
  const Int4 columns = whole(column), rows = whole(row);
  const Int4 heights_mm = whole((z - kLowest_m) * 1000.0F + 0.5F) + kLowest_mm;
  for (int k = 0; k < 4; ++k) {
    if (taken[k] != 0) add_to_cell(x[k], y[k], z[k], heights_mm[k], columns[k], rows[k]);
  }
}

void Segmenter::add_to_cell(float x_m, float y_m, float z_m, std::int32_t height_mm, int column, int row) noexcept {
  const std::size_t i = with_rim(column, row);
  const auto height = static_cast<std::int16_t>(height_mm);
  if (lowest_mm_[i] == kNoLowest_mm) {
    touched_.push_back({static_cast<std::int16_t>(column), static_cast<std::int16_t>(row)});
  }
  lowest_mm_[i] = std::min(lowest_mm_[i], height);
  highest_mm_[i] = std::max(highest_mm_[i], height);
  points_.push_back({x_m, y_m, z_m, window_.index(column, row)});
}

/// Lowest return of each coarse cell and its neighbours: the street itself, even where a cell holds only a roof or a
/// branch.
void Segmenter::find_streets() noexcept {
  for (const Place at : touched_) {
    std::int16_t& lowest = coarse_lowest_mm_[coarse(at)];
    lowest = std::min(lowest, lowest_mm_[with_rim(at.column, at.row)]);
  }
  for (int row = 0; row < coarse_size_; ++row) {
    for (int column = 0; column < coarse_size_; ++column) {
      std::int16_t lowest = kNoLowest_mm;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, coarse_size_ - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, coarse_size_ - 1); ++c) {
          lowest = std::min(lowest, coarse_lowest_mm_[static_cast<std::size_t>(r * coarse_size_ + c)]);
        }
      }
      street_mm_[static_cast<std::size_t>(row * coarse_size_ + column)] = lowest;
    }
  }
}

std::int16_t Segmenter::lowest_nearby_mm(Place at) const noexcept {
  Row lowest = Row{} + kNoLowest_mm;
  for (int dr = -kReach; dr <= kReach; ++dr) {
    lowest = lower(lowest, load<Row>(&lowest_mm_[with_rim(at.column - kReach, at.row + dr)]));
  }
  return std::min({lowest[0], lowest[1], lowest[2], lowest[3], lowest[4]});
}

/// Mean of the lowest cells within kReach, each lifted by what the allowed slope explains over its distance.
float Segmenter::road_height_m(Place at) const noexcept {
  LowestRows lowest(static_cast<std::size_t>(config_.lowest_count));
  const std::int16_t one = mm_from_m(config_.slope * window_.cell_m());
  const auto two = static_cast<std::int16_t>(2 * one);
  const Row far{two, two, two, two, two, kNoLowest_mm, kNoLowest_mm, kNoLowest_mm};
  const Row near{two, one, one, one, two, kNoLowest_mm, kNoLowest_mm, kNoLowest_mm};
  const Row here{two, one, 0, one, two, kNoLowest_mm, kNoLowest_mm, kNoLowest_mm};
  const std::array<Row, 2 * kReach + 1> lift{far, near, here, near, far};
  for (int dr = -kReach; dr <= kReach; ++dr) {
    lowest.add(load<Row>(&lowest_mm_[with_rim(at.column - kReach, at.row + dr)]) +
               lift[static_cast<std::size_t>(dr + kReach)]);
  }
  lowest.fold();
  std::int32_t sum_mm = 0;
  int count = 0;
  for (std::size_t k = 0; k < lowest.count && lowest.rows[k][0] < kHighestReal_mm; ++k, ++count) {
    sum_mm += lowest.rows[k][0];
  }
  return count > 0 ? m_from_mm(static_cast<float>(sum_mm) / static_cast<float>(count)) : 0;
}

void Segmenter::find_obstacles() noexcept {
  const std::int16_t step = mm_from_m(config_.step_m), structure = mm_from_m(config_.structure_step_m),
                     under = mm_from_m(config_.span_m);
  for (const Place at : touched_) {
    const std::size_t i = with_rim(at.column, at.row);
    const auto cell = static_cast<std::size_t>(window_.index(at.column, at.row));
    const int street = street_mm_[coarse(at)];
    result_.seen[cell] = lowest_mm_[i] < street + under;
    // The road's height is worth its cost only where something could stand above it.
    if (highest_mm_[i] <= std::min(lowest_nearby_mm(at) + step, street + structure)) continue;
    if (obstacles_.size() == obstacles_.capacity()) continue;
    const float road_m = road_height_m(at), street_m = m_from_mm(static_cast<float>(street));
    const float lowest_m = m_from_mm(lowest_mm_[i]), highest_m = m_from_mm(highest_mm_[i]);
    obstacle_of_[cell] = static_cast<std::int32_t>(obstacles_.size());
    obstacle_bits_[cell / 64] |= std::uint64_t{1} << (cell % 64);
    obstacles_.push_back(
        {.cell = static_cast<std::int32_t>(cell),
         .road_m = road_m,
         .step_m = road_m + static_cast<float>(config_.step_m),
         .structure_m = street_m + static_cast<float>(config_.structure_step_m),
         .limit_m = street_m + static_cast<float>(config_.span_m),
         .edge_seen = lowest_m - road_m <= kRoadShare * (highest_m - road_m) || highest_mm_[i] > street + structure,
         .boundary = {},
         .structure = {}});
  }
}

void Segmenter::tally_obstacles() noexcept {
  for (const Point& p : points_) {
    const auto cell = static_cast<std::size_t>(p.cell);
    if ((obstacle_bits_[cell / 64] >> (cell % 64) & 1) == 0) continue;
    Obstacle& obstacle = obstacles_[static_cast<std::size_t>(obstacle_of_[cell])];
    const bool tall = p.z_m > obstacle.structure_m;
    if ((p.z_m <= obstacle.step_m && !tall) || p.z_m >= obstacle.limit_m) continue;
    if (obstacle.boundary.count == 0) {
      obstacle.x0_m = p.x_m;
      obstacle.y0_m = p.y_m;
    }
    const float x = p.x_m - obstacle.x0_m, y = p.y_m - obstacle.y0_m;
    obstacle.boundary.add(x, y);
    if (tall) obstacle.structure.add(x, y);
    obstacle.top_m = std::max(obstacle.top_m, p.z_m);
  }
}

void Segmenter::Moments::add(float x, float y) noexcept {
  count += 1;
  x_m += x;
  y_m += y;
  xx_m2 += x * x;
  yy_m2 += y * y;
}

BoundaryCell Segmenter::cell_of(const Obstacle& obstacle, const Moments& moments) noexcept {
  const auto n = static_cast<float>(moments.count);
  const float x = moments.x_m / n, y = moments.y_m / n;
  const float unseen_m = obstacle.edge_seen ? 0.0F : kUnseenEdge_m;
  const float variance =
      unseen_m * unseen_m + std::max(0.0F, 0.5F * (moments.xx_m2 / n - x * x + moments.yy_m2 / n - y * y));
  const float road_m = std::min(obstacle.road_m, obstacle.top_m);
  return {obstacle.x0_m + x, obstacle.y0_m + y, road_m, obstacle.top_m - road_m, std::sqrt(variance), 1.0F,
          moments.count,     obstacle.edge_seen};
}

bool Segmenter::is_boundary(const Obstacle& obstacle) const noexcept {
  const std::uint32_t count = obstacle.boundary.count;
  if (count >= static_cast<std::uint32_t>(config_.return_count)) return true;
  return count > 0 && obstacle.edge_seen && has_boundary_beside(obstacle.cell);
}

/// Enough returns for a boundary, in one of the eight cells around.
bool Segmenter::has_boundary_beside(int cell) const noexcept {
  const int size = window_.size(), column = cell % size, row = cell / size;
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, size - 1); ++r) {
    for (int c = std::max(column - 1, 0); c <= std::min(column + 1, size - 1); ++c) {
      const auto beside = static_cast<std::size_t>(window_.index(c, r));
      if ((obstacle_bits_[beside / 64] >> (beside % 64) & 1) == 0) continue;
      const Obstacle& other = obstacles_[static_cast<std::size_t>(obstacle_of_[beside])];
      if (other.boundary.count >= static_cast<std::uint32_t>(config_.return_count)) return true;
    }
  }
  return false;
}

void Segmenter::report() noexcept {
  const auto enough = static_cast<std::uint32_t>(config_.return_count);
  for (const Obstacle& obstacle : obstacles_) {
    if (is_boundary(obstacle)) result_.boundary.add(obstacle.cell, cell_of(obstacle, obstacle.boundary));
    if (obstacle.structure.count >= enough) result_.structure.add(obstacle.cell, cell_of(obstacle, obstacle.structure));
  }
}

}  // namespace roadvec
