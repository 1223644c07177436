#pragma once

#include <span>

#include "core/boundary/fuse.h"
#include "core/boundary/segment.h"
#include "core/boundary/simplify.h"
#include "core/boundary/vectorise.h"
#include "core/boundary/virtual_scan.h"
#include "core/map/match.h"
#include "core/odometry/odometry.h"
#include "core/pipeline/config.h"
#include "core/pipeline/keyframe.h"
#include "core/pipeline/report.h"
#include "core/sensor/lidar.h"
#include "core/sensor/motion.h"

namespace roadvec {

/// What the front end must know of the car and its sensor.
struct FrontEndSetup {
  VehicleGeometry vehicle;
  LidarMounting lidar;
  std::size_t max_returns_per_sweep = 0;
};

/// Steps 0 to 6 of the flowchart: sweeps and motion in, keyframes out, all in the odom frame. Its output depends on
/// sensor data alone, never on the back end or on when it runs.
///
/// add() does not allocate, lock, throw or read a clock: it belongs on a real-time thread. Memory is reserved in the
/// constructor.
class FrontEnd {
 public:
  FrontEnd(const PipelineConfig& config, const FrontEndSetup& setup, StepProbe& probe);

  /// One revolution and the motion samples up to its end. Gives the keyframe filled into `slot` if the vehicle moved
  /// far enough (or null); `slot` may be null while the consumer is behind: the keyframe is then taken at the next
  /// sweep.
  Keyframe* add(const Sweep& sweep, std::span<const MotionSample> motion, Keyframe* slot) noexcept;

  /// Motion alone, while no sweep comes; up to the last sample. Later sweeps begin after it.
  void coast(std::span<const MotionSample> motion) noexcept;

  [[nodiscard]] const Odometry& odometry() const { return odometry_; }
  [[nodiscard]] const FrontEndReport& report() const { return report_; }
  [[nodiscard]] const Match& last_match() const { return match_; }
  /// Raw and simplified LVM in the odom frame after the last add(): for pictures and tests.
  [[nodiscard]] const LineSet& raw_lvm_odom() const { return *raw_lvm_; }
  [[nodiscard]] const LineSet& lvm_odom() const { return *lvm_; }
  [[nodiscard]] const LineSet& structure_odom() const { return *structure_; }

 private:
  void match_sweep(const VirtualScan& structure, const VirtualScan& boundary) noexcept;
  Keyframe* take_keyframe(Keyframe* slot) noexcept;
  void copy_near(const LineSet& lines_odom, const Pose2& T_vehicle_odom, LineSet& out) const;

  PipelineConfig config_;
  StepProbe& probe_;
  Odometry odometry_;
  Segmenter segmenter_;
  VirtualScanner sweep_boundary_scanner_, sweep_structure_scanner_, boundary_scanner_, structure_scanner_;
  LocalGrid boundary_grid_, structure_grid_;
  Vectoriser sweep_vectoriser_, boundary_vectoriser_, structure_vectoriser_;
  Simplifier boundary_simplifier_, structure_simplifier_;
  Matcher matcher_;
  Match match_;
  LineSet sweep_lines_, local_map_odom_;
  const LineSet* raw_lvm_ = nullptr;
  const LineSet* lvm_ = nullptr;
  const LineSet* structure_ = nullptr;
  LidarMounting mounting_;
  FrontEndReport report_;
  Pose2 last_pose_, last_keyframe_pose_;
  bool has_keyframe_ = false;
};

}  // namespace roadvec
