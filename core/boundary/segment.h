#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/boundary/window.h"
#include "core/geometry/path.h"
#include "core/sensor/lidar.h"

namespace roadvec {

struct SegmentConfig {
  double step_m =
      0.07;  ///< 0.09, the paper group's, loses kerbs of 10 cm to noise and slope; 0.05 takes in verges (measured)
  double structure_step_m =
      0.5;               ///< measured: matching on what is higher finds its way, lower cells move with the sensor
  double span_m = 2.2;   ///< height of a car with its sensor: what is higher is driven under [He2018, III-A-2]
  double slope = 0.08;   ///< steepest street that is still road: 8 %
  int lowest_count = 3;  ///< the paper's m
  int return_count = 2;  ///< fewer returns in a cell are noise (choice)
  double body_ahead_m = 3.9, body_behind_m = 1.2, body_side_m = 1.1;  ///< a passenger car around its rear axle (choice)
};
template <class Visitor>
void visit_fields(SegmentConfig& c, Visitor&& field) {
  field("segment.step_m", c.step_m, 0.02, 1.0, "height above the road from which a return belongs to a boundary");
  field("segment.structure_step_m", c.structure_step_m, 0.1, 2.0,
        "height from which it also belongs to tall structure");
  field("segment.span_m", c.span_m, 0.5, 6.0, "height above the road beyond which the vehicle passes underneath");
  field("segment.slope", c.slope, 0.0, 0.3, "slope of the road that is not taken for a step");
  field("segment.lowest_count", c.lowest_count, 1, 10, "lowest cells nearby whose mean is the road's height");
  field("segment.return_count", c.return_count, 1, 20, "returns that make a cell an obstacle");
  field("segment.body_ahead_m", c.body_ahead_m, 0.0, 20.0,
        "own bodywork ahead of the rear axle: returns inside are dropped");
  field("segment.body_behind_m", c.body_behind_m, 0.0, 20.0, "own bodywork behind the rear axle");
  field("segment.body_side_m", c.body_side_m, 0.0, 5.0, "own bodywork to each side");
}

/// Where the LiDAR sits in the vehicle frame: p_vehicle = rotation * p_lidar + translation.
struct LidarMounting {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
};
/// R = Rz(yaw) Ry(pitch) Rx(roll).
[[nodiscard]] LidarMounting mounting_from(const Eigen::Vector3d& translation_m, double roll_rad, double pitch_rad,
                                          double yaw_rad);

/// What one sweep shows: cells of the road's boundaries, cells of tall structure, and which cells were seen at all.
struct Segmentation {
  explicit Segmentation(const WindowConfig& config)
      : boundary(config), structure(config), seen(boundary.window().cell_count(), 0) {}
  CellMap boundary;
  CellMap structure;
  std::vector<std::uint8_t>
      seen;                      ///< 1: some return lies in the cell, so that a boundary there would have been noticed
  std::size_t return_count = 0;  ///< inside the window
};

/// Step 1, segment: returns -> obstacle cells [He2018, III-A-2].
///
/// Each return is de-skewed with the path and dropped into a cell. The road's height at a cell is the mean of the
/// lowest returns nearby; a return between step_m and span_m above it belongs to a boundary. Differs from the paper:
/// "nearby" is a square metre centred on the cell instead of a fixed coarser cell, because a kerb on a coarse cell's
/// rim leaves no step inside any cell; and it leans with the steepest slope allowed, so that a hill is not a step.
/// Far away a ring leaves one return on the kerb's edge and its others on the sidewalk: that one return makes a
/// boundary when there is more beside it, or the kerb would lie a cell too far out; cells of sidewalk alone are marked
/// as such. Cost: two passes over the returns, one over the cells touched. No allocation.
class Segmenter {
 public:
  Segmenter(const SegmentConfig& config, const WindowConfig& window, const LidarMounting& mounting,
            std::size_t max_returns);
  /// `path` covers the sweep. Window coordinates; the window is centred on the vehicle at the path's end. Valid until
  /// next call.
  const Segmentation& run(const Sweep& sweep, const Path& path_odom) noexcept;

 private:
  /// p = rotation p_lidar + shift.
  struct Transform {
    Eigen::Matrix3f rotation;
    Eigen::Vector3f shift_m;
  };
  struct Point {
    float x_m, y_m, z_m;  // window coordinates, height above the vehicle's ground plane
    std::int32_t cell;
  };
  struct Place {
    std::int16_t column, row;
  };
  struct Moments {
    std::uint32_t count = 0;
    float x_m = 0, y_m = 0, xx_m2 = 0, yy_m2 = 0;
    void add(float x, float y) noexcept;
  };
  /// A cell in which something may stand on the road, with the returns that do.
  struct Obstacle {
    std::int32_t cell = 0;
    float road_m = 0;
    float step_m = 0, structure_m = 0, limit_m = 0;  // heights: from step_m or structure_m up to limit_m is an obstacle
    bool edge_seen = false;                          // road and obstacle meet in the cell
    float x0_m = 0, y0_m = 0;  // first return: sums relative to it, floats would not hold squares of whole coordinates
    float top_m = -100;
    Moments boundary, structure;
  };
  static constexpr int kReach = 2;         // cells each way: the square metre around a cell
  static constexpr int kCoarseCells = 10;  // 2 m: wide enough to hold road beside any obstacle

  void forget_last_sweep() noexcept;
  void place(const Sweep& sweep, const Path& path_odom) noexcept;
  void place_four(const Return* echoes, const Transform& T_window_lidar) noexcept;
  void add_to_cell(float x_m, float y_m, float z_m, std::int32_t height_mm, int column, int row) noexcept;
  void find_streets() noexcept;
  void find_obstacles() noexcept;
  void tally_obstacles() noexcept;
  void report() noexcept;
  [[nodiscard]] static BoundaryCell cell_of(const Obstacle& obstacle, const Moments& moments) noexcept;
  [[nodiscard]] bool is_boundary(const Obstacle& obstacle) const noexcept;
  [[nodiscard]] bool has_boundary_beside(int cell) const noexcept;
  [[nodiscard]] std::int16_t lowest_nearby_mm(Place place) const noexcept;
  [[nodiscard]] float road_height_m(Place place) const noexcept;
  /// In lowest_mm_ and highest_mm_, whose rim of kReach cells is always empty.
  [[nodiscard]] std::size_t with_rim(int column, int row) const noexcept {
    return static_cast<std::size_t>(row + kReach) * stride_ + static_cast<std::size_t>(column + kReach);
  }
  [[nodiscard]] std::size_t coarse(Place place) const noexcept {
    return static_cast<std::size_t>((place.row / kCoarseCells) * coarse_size_ + place.column / kCoarseCells);
  }

  SegmentConfig config_;
  Window window_;
  LidarMounting mounting_;
  Transform T_vehicle_lidar_;
  std::vector<Point> points_;
  std::size_t stride_;
  // Of the returns in each cell; in millimetres, so that a row of neighbours fits into one SIMD register.
  std::vector<std::int16_t> lowest_mm_, highest_mm_;
  std::vector<Place> touched_;  // cells with returns
  int coarse_size_;
  std::vector<std::int16_t> coarse_lowest_mm_, street_mm_;  // per coarse cell: lowest return; also of its neighbours
  std::vector<std::int32_t> obstacle_of_;                   // per cell: into obstacles_, where the bit is set
  std::vector<std::uint64_t> obstacle_bits_;  // per cell: something may stand in it; stays in the first-level cache
  std::vector<Obstacle> obstacles_;
  Segmentation result_;
};

}  // namespace roadvec
