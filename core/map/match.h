#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/geometry/line_set.h"
#include "core/geometry/pose2.h"
#include "core/map/segment_index.h"

namespace roadvec {

struct MatchConfig {
  double sample_spacing_m = 1.0;      ///< choice: twice as dense costs twice the time and gains under 5 % (bench/map)
  double first_gate_m = 2.0;          ///< a start 0.5 m and 3 deg off moves a line 30 m away by 2.1 m
  double last_gate_m = 0.3;           ///< choice: three times the spread of a line seen by a HDL-64E at 20 m
  double angle_gate_deg = 30.0;       ///< choice: kerb radii of 3 m turn by less between two vertices
  bool directed = true;               ///< lines made by the virtual scan run clockwise: the free side is on their right
  double min_sigma_m = 0.02;          ///< range noise of a HDL-64E [VelodyneHDL64]: no vertex is better than that
  double correlation_length_m = 2.0;  ///< choice: errors of neighbouring samples are one error, not two
  double characteristic_length_m = 10.0;  ///< choice: half the usual distance between seen lines; weighs 0.1 rad as 1 m
  double min_contrast = 0.01;  ///< share of the lines' weight that must face a direction; 0.01 is 6 deg off parallel
  double min_length_m = 6.0;   ///< choice: shorter than that, one parked car's side would be a match
  double min_overlap = 0.3;    ///< choice; KISS-SLAM asks for 0.4 of point clouds
  double max_rms_m = 0.12;     ///< choice: twice the simplification tolerance
  double max_shift_m = 4.0;    ///< from the guess; choice: a lane's width is a wrong match
  double max_turn_deg = 12.0;  ///< from the guess; choice
  int max_iterations = 30;     ///< usual: 6 to 12
};
template <class Visitor>
void visit_fields(MatchConfig& c, Visitor&& field) {
  field("match.sample_spacing_m", c.sample_spacing_m, 0.1, 5.0,
        "distance of the points taken along an unregistered line");
  field("match.first_gate_m", c.first_gate_m, 0.1, 10.0,
        "greatest distance of a pair at first, when the guess is poor");
  field("match.last_gate_m", c.last_gate_m, 0.05, 2.0, "greatest distance of a pair at last");
  field("match.angle_gate_deg", c.angle_gate_deg, 1.0, 90.0, "greatest angle between the lines of a pair");
  field("match.directed", c.directed, "lines of a pair run the same way (free side on the right)");
  field("match.min_sigma_m", c.min_sigma_m, 0.001, 0.5, "smallest standard deviation a vertex is believed to have");
  field("match.correlation_length_m", c.correlation_length_m, 0.1, 50.0,
        "length of line that counts as one measurement");
  field("match.characteristic_length_m", c.characteristic_length_m, 1.0, 100.0,
        "length that turns an angle into a distance");
  field("match.min_contrast", c.min_contrast, 0.0001, 0.5,
        "share of the weight that must face a direction to observe it");
  field("match.min_length_m", c.min_length_m, 0.5, 100.0, "paired length below which there is no match");
  field("match.min_overlap", c.min_overlap, 0.0, 1.0, "share of the unregistered length that must have a partner");
  field("match.max_rms_m", c.max_rms_m, 0.01, 1.0, "greatest root mean square distance of the pairs");
  field("match.max_shift_m", c.max_shift_m, 0.1, 50.0, "greatest distance from the guess");
  field("match.max_turn_deg", c.max_turn_deg, 0.5, 180.0, "greatest angle from the guess");
  field("match.max_iterations", c.max_iterations, 1, 200,
        "iterations after which a match that still moves has diverged");
}

enum class MatchVerdict : std::uint8_t {
  accepted = 0,
  partly_observable = 1,  ///< accepted; says nothing along Match::unobservable (or of the heading)
  too_few_lines = 2,
  poor_overlap = 3,
  poor_fit = 4,
  diverged = 5,
};

struct Match {
  MatchVerdict verdict = MatchVerdict::too_few_lines;
  Pose2 pose;  ///< T_reference_vehicle: best estimate from lines and guess together; the guess where there is no match
  PoseCovariance covariance = PoseCovariance::Zero();  ///< of `pose`: lines and guess together
  Eigen::Matrix3d information =
      Eigen::Matrix3d::Zero();                  ///< of the lines alone, guess excluded; singular where unobservable
  double overlap = 0;                           ///< share of the unregistered length with a partner
  double rms_m = 0;                             ///< across, of the pairs
  std::optional<Eigen::Vector2d> unobservable;  ///< unit vector, reference frame: along it `pose` is the guess
  bool heading_observed = false;
  int iteration_count = 0, pair_count = 0;

  [[nodiscard]] bool usable() const {
    return verdict == MatchVerdict::accepted || verdict == MatchVerdict::partly_observable;
  }
};

/// Distance of the moved point from the reference line, n^T (R p + T - q), and its derivative by (x, y, theta) of (R,
/// T). n: unit normal of the line, q: any of its points, reference frame. [He2018, III-C-1]
struct NodeToLine {
  double residual_m = 0;
  Eigen::Vector3d jacobian;
};
[[nodiscard]] inline NodeToLine node_to_line(const Pose2& pose, const Eigen::Vector2d& p, const Eigen::Vector2d& q,
                                             const Eigen::Vector2d& n) {
  const Eigen::Vector2d moved = pose * p;
  const Eigen::Vector2d arm = moved - pose.translation();
  return {n.dot(moved - q), {n.x(), n.y(), n.y() * arm.x() - n.x() * arm.y()}};
}

/// Step 6, match: polyline-to-polyline ICP with the residual J = sum |n^T (R p + T - q)|^2 [He2018, III-C-1]
/// [Censi2008].
///
/// set_reference() once, then any number of run(). No allocation once warm, bounded time, one thread.
/// Differs from the paper: (1) the nodes p are also taken along the lines, every sample_spacing_m, because a simplified
/// straight kerb has two nodes only; (2) nodes of the reference are paired with the unregistered lines too; (3) robust
/// weights whose scale shrinks with the gate (graduated Geman-McClure); (4) the guess counts with its covariance; (5) a
/// direction that the lines do not show is found [Zhang2016], taken out of their information and left to the guess.
class Matcher {
 public:
  explicit Matcher(const MatchConfig& config);

  /// Lines to match against, any frame. Copied into an index.
  void set_reference(const LineSet& reference) noexcept;
  /// `guess_covariance`: of guess_reference_vehicle, in the reference frame; large = no prior. Valid until the next
  /// call.
  const Match& run(const LineSet& lines_vehicle, const Pose2& guess_reference_vehicle,
                   const PoseCovariance& guess_covariance) noexcept;

 private:
  struct Sample {
    Eigen::Vector2d p, direction;
    double variance_m2, length_m;
  };
  struct Pair {
    Eigen::Vector2d p, q, n;  ///< moving point (vehicle), point and normal of the line (reference)
    double inverse_variance_m2, share, length_m;
  };
  struct Sums;
  void take_samples() noexcept;
  void take_reference_nodes(const LineSet& reference) noexcept;
  [[nodiscard]] double start_gate_m(const PoseCovariance& guess_covariance) const;
  void pair_up(const Pose2& pose, double gate_m, bool fine) noexcept;
  void pair_samples(const Pose2& pose, const SegmentIndex::Gate& gate, std::size_t stride) noexcept;
  void pair_reference_nodes(const Pose2& pose, const SegmentIndex::Gate& gate) noexcept;
  [[nodiscard]] double inverse_variance_m2(double variance_m2, const SegmentIndex::Item& item, double along_m) const;
  [[nodiscard]] Sums sum_up(const Pose2& pose, double robust_scale_m) const noexcept;
  void leave_out_unobservable(Sums& sums) noexcept;
  [[nodiscard]] MatchVerdict judge(const Sums& sums, double paired_m, const Pose2& guess, bool converged) noexcept;

  MatchConfig config_;
  double min_cos_, max_turn_rad_;
  SegmentIndex reference_, unregistered_;
  std::vector<Sample> samples_, reference_nodes_;
  std::vector<Pair> pairs_;
  double samples_length_m_ = 0, samples_radius_m_ = 0;
  Match match_;
};

}  // namespace roadvec
