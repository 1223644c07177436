#include "core/map/match.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/base/square.h"

namespace roadvec {
namespace {

// While the gate is wide the pairs are rough anyway: every fourth sample steers as well as all of them.
constexpr std::size_t kCoarseStride = 4;
constexpr std::size_t kFewSamples = 64;
constexpr double kShrink = 0.6;
constexpr std::size_t kFewestPairs = 3;
constexpr double kRobustShare = 0.5;  // of the gate: there a residual has a quarter of its weight left
constexpr double kSmallStep_m = 5e-4;
// Pairs are kept while the lines move less than this: a foot slides along its segment, which changes nothing.
constexpr double kPairAgain_m = 0.01;
// A foot this far beyond the end of a line is still on it: ends are uncertain by about a grid cell.
constexpr double kEndSlack_m = 0.1;

constexpr std::size_t kSampleReserve = 8192;  // 4 km of lines in one local map

struct Rotation {
  double c, s;
  explicit Rotation(double angle_rad) : c(std::cos(angle_rad)), s(std::sin(angle_rad)) {}
  Eigen::Vector2d operator*(const Eigen::Vector2d& v) const { return {c * v.x() - s * v.y(), s * v.x() + c * v.y()}; }
};
/// Smaller eigenvalue of a symmetric 2 x 2 matrix and its unit vector.
struct Weakest {
  double value = 0;
  Eigen::Vector2d direction;
};
Weakest weakest(const Eigen::Matrix2d& m) {
  const double mean = 0.5 * (m(0, 0) + m(1, 1)), half = 0.5 * (m(0, 0) - m(1, 1));
  const double strongest_angle = 0.5 * std::atan2(m(0, 1), half);
  return {mean - std::hypot(half, m(0, 1)), {-std::sin(strongest_angle), std::cos(strongest_angle)}};
}

}  // namespace

/// Normal equations H d = -g over (x, y, theta), and what the verdict needs.
struct Matcher::Sums {
  Eigen::Matrix3d H;
  Eigen::Vector3d g;
  double weight = 0;          ///< sum of robust weight / variance
  double robust = 0;          ///< sum of robust weights
  double squares_m2 = 0;      ///< sum of robust weight * r^2
  double normed_squares = 0;  ///< the same, in variances
};

Matcher::Matcher(const MatchConfig& config)
    : config_(config),
      min_cos_(std::cos(rad_from_deg(config.angle_gate_deg))),
      max_turn_rad_(rad_from_deg(config.max_turn_deg)),
      reference_(kIndexCell_m),
      unregistered_(kIndexCell_m) {
  samples_.reserve(kSampleReserve);
  reference_nodes_.reserve(kSampleReserve);
  pairs_.reserve(2 * kSampleReserve);
}

void Matcher::set_reference(const LineSet& reference) noexcept {
  reference_.build(reference);
  take_reference_nodes(reference);
}

/// Nodes within a line: there the direction is known from both sides; ends move with the view. Dense nodes are thinned.
void Matcher::take_reference_nodes(const LineSet& reference) noexcept {
  reference_nodes_.clear();
  for (const LineSet::Line& line : reference.lines()) {
    const std::span<const Vertex> v = reference.vertices_of(line);
    double since_last_m = 0;
    for (std::size_t i = 1; i + 1 < v.size(); ++i) {
      since_last_m += (v[i].position() - v[i - 1].position()).norm();
      const Eigen::Vector2d chord = v[i + 1].position() - v[i - 1].position();
      const double chord_m = chord.norm();
      if (chord_m <= 0 || since_last_m < config_.sample_spacing_m) continue;
      reference_nodes_.push_back(
          {v[i].position(), chord / chord_m, square(v[i].sigma_across_m), config_.sample_spacing_m});
      since_last_m = 0;
    }
  }
}

/// Points every sample_spacing_m along each line, the first half a spacing from its start. A line shorter than that has
/// one.
void Matcher::take_samples() noexcept {
  samples_.clear();
  samples_length_m_ = 0;
  double radius2_m3 = 0;
  const double spacing_m = config_.sample_spacing_m;
  double until_next_m = 0;
  for (const SegmentIndex::Item& item : unregistered_.items()) {
    if (item.first_of_line) until_next_m = 0.5 * spacing_m;
    for (; until_next_m < item.length_m; until_next_m += spacing_m) {
      samples_.push_back(
          {item.a + until_next_m * item.direction, item.direction, item.variance_at(until_next_m), spacing_m});
      radius2_m3 += spacing_m * samples_.back().p.squaredNorm();
      samples_length_m_ += spacing_m;
    }
    until_next_m -= item.length_m;
  }
  samples_radius_m_ = samples_length_m_ > 0 ? std::sqrt(radius2_m3 / samples_length_m_) : 0.0;
}

/// Where the lines may lie for the guess's 3 sigma, no wider than first_gate_m.
double Matcher::start_gate_m(const PoseCovariance& guess_covariance) const {
  const double variance_m2 =
      guess_covariance(0, 0) + guess_covariance(1, 1) + guess_covariance(2, 2) * square(samples_radius_m_);
  const double wanted_m = config_.last_gate_m + 3.0 * std::sqrt(std::max(0.0, variance_m2));
  return std::clamp(wanted_m, config_.last_gate_m, std::max(config_.first_gate_m, config_.last_gate_m));
}

double Matcher::inverse_variance_m2(double variance_m2, const SegmentIndex::Item& item, double along_m) const {
  const double least_m2 = square(config_.min_sigma_m);
  return 1.0 / (std::max(variance_m2, least_m2) + std::max(item.variance_at(along_m), least_m2));
}

void Matcher::pair_samples(const Pose2& pose, const SegmentIndex::Gate& gate, std::size_t stride) noexcept {
  const Rotation R(pose.theta_rad);
  const double length_m = static_cast<double>(stride) * config_.sample_spacing_m;
  const double share = std::min(1.0, length_m / config_.correlation_length_m);
  for (std::size_t i = 0; i < samples_.size(); i += stride) {
    const Sample& sample = samples_[i];
    const auto hit = reference_.nearest(R * sample.p + pose.translation(), R * sample.direction, gate);
    if (!hit || hit->overshoot_m > kEndSlack_m) continue;
    const SegmentIndex::Item& item = reference_.items()[hit->item];
    pairs_.push_back({sample.p, item.a, item.normal(), inverse_variance_m2(sample.variance_m2, item, hit->along_m),
                      share, length_m});
  }
}

/// The other direction: foot f of a reference node on an unregistered line is the point that moves, with the line's own
/// normal. That normal turns with R, but at the foot its derivative is perpendicular to the residual: same Jacobian.
void Matcher::pair_reference_nodes(const Pose2& pose, const SegmentIndex::Gate& gate) noexcept {
  const Pose2 inverse = pose.inverse();
  const Rotation R(pose.theta_rad), R_inverse(inverse.theta_rad);
  // Both directions see the same lines: a node speaks for one sample, so that what is counted twice stays small.
  const double share = std::min(1.0, config_.sample_spacing_m / config_.correlation_length_m);
  for (const Sample& node : reference_nodes_) {
    const auto hit =
        unregistered_.nearest(R_inverse * node.p + inverse.translation(), R_inverse * node.direction, gate);
    if (!hit || hit->overshoot_m > kEndSlack_m) continue;
    const SegmentIndex::Item& item = unregistered_.items()[hit->item];
    const Eigen::Vector2d foot = item.a + hit->along_m * item.direction;
    pairs_.push_back(
        {foot, node.p, R * item.normal(), inverse_variance_m2(node.variance_m2, item, hit->along_m), share, 0.0});
  }
}

void Matcher::pair_up(const Pose2& pose, double gate_m, bool fine) noexcept {
  const SegmentIndex::Gate gate{gate_m, min_cos_, config_.directed};
  pairs_.clear();
  pair_samples(pose, gate, fine || samples_.size() < kFewSamples ? 1 : kCoarseStride);
  if (fine) pair_reference_nodes(pose, gate);
}

/// Written out by component: the inner loop of the whole step.
Matcher::Sums Matcher::sum_up(const Pose2& pose, double robust_scale_m) const noexcept {
  Sums sums;
  const Rotation R(pose.theta_rad);
  const double inverse_scale2 = 1.0 / square(robust_scale_m);
  double xx = 0, xy = 0, xt = 0, yy = 0, yt = 0, tt = 0, gx = 0, gy = 0, gt = 0;
  for (const Pair& pair : pairs_) {
    const double arm_x = R.c * pair.p.x() - R.s * pair.p.y(), arm_y = R.s * pair.p.x() + R.c * pair.p.y();
    const double nx = pair.n.x(), ny = pair.n.y(), nt = ny * arm_x - nx * arm_y;
    const double r = nx * (arm_x + pose.x_m - pair.q.x()) + ny * (arm_y + pose.y_m - pair.q.y());
    // Geman-McClure: quadratic near 0, without influence far beyond the scale.
    const double rho = 1.0 / square(1.0 + r * r * inverse_scale2);
    const double w = rho * pair.share * pair.inverse_variance_m2;
    xx += w * nx * nx;
    xy += w * nx * ny;
    xt += w * nx * nt;
    yy += w * ny * ny;
    yt += w * ny * nt;
    tt += w * nt * nt;
    gx += w * nx * r;
    gy += w * ny * r;
    gt += w * nt * r;
    sums.weight += w;
    sums.robust += rho;
    sums.squares_m2 += rho * r * r;
    sums.normed_squares += rho * r * r * pair.inverse_variance_m2;
  }
  sums.H << xx, xy, xt, xy, yy, yt, xt, yt, tt;
  sums.g << gx, gy, gt;
  return sums;
}

/// Takes out of H and g what the lines do not show, exactly: with v the weakest direction, H v = 0 and g^T v = 0
/// afterwards. Tested on the translation with the heading free (Schur complement), as a share of all weight:
/// independent of how many samples there are and how good they claim to be.
void Matcher::leave_out_unobservable(Sums& sums) noexcept {
  Eigen::Matrix3d& H = sums.H;
  const double heading = H(2, 2);
  const Eigen::Vector2d coupling = H.block<2, 1>(0, 2);
  match_.heading_observed = heading > config_.min_contrast * sums.weight * square(config_.characteristic_length_m);
  const Eigen::Vector2d turn_per_metre =
      heading > 0 ? Eigen::Vector2d(coupling / heading) : Eigen::Vector2d(Eigen::Vector2d::Zero());
  const Eigen::Matrix2d translation = H.block<2, 2>(0, 0) - coupling * turn_per_metre.transpose();
  if (!match_.heading_observed) {
    sums.g.head<2>() -= turn_per_metre * sums.g(2);
    sums.g(2) = 0;
    H.setZero();
    H.block<2, 2>(0, 0) = translation;
  }
  const Weakest weak = weakest(translation);
  match_.unobservable.reset();
  if (weak.value >= config_.min_contrast * sums.weight) return;
  const Eigen::Vector2d& u = weak.direction;
  match_.unobservable = u;
  const double g_along = u.dot(sums.g.head<2>()) - (match_.heading_observed ? u.dot(turn_per_metre) * sums.g(2) : 0.0);
  H.block<2, 2>(0, 0) -= weak.value * u * u.transpose();
  sums.g.head<2>() -= g_along * u;
}

MatchVerdict Matcher::judge(const Sums& sums, double paired_m, const Pose2& guess, bool converged) noexcept {
  if (samples_length_m_ < config_.min_length_m || reference_.items().empty()) return MatchVerdict::too_few_lines;
  match_.overlap = std::min(1.0, paired_m / samples_length_m_);
  if (match_.overlap < config_.min_overlap || paired_m < config_.min_length_m || pairs_.size() < kFewestPairs) {
    return MatchVerdict::poor_overlap;
  }
  match_.rms_m = std::sqrt(sums.squares_m2 / sums.robust);
  const double shift_m = (match_.pose.translation() - guess.translation()).norm();
  const double turn_rad = std::abs(wrap_rad(match_.pose.theta_rad - guess.theta_rad));
  // Written so that a pose that is not a number has diverged too.
  const bool near_guess = shift_m <= config_.max_shift_m && turn_rad <= max_turn_rad_;
  if (!converged || !near_guess) return MatchVerdict::diverged;
  if (match_.rms_m > config_.max_rms_m) return MatchVerdict::poor_fit;
  const bool whole = match_.heading_observed && !match_.unobservable;
  return whole ? MatchVerdict::accepted : MatchVerdict::partly_observable;
}

const Match& Matcher::run(const LineSet& lines_vehicle, const Pose2& guess,
                          const PoseCovariance& guess_covariance) noexcept {
  unregistered_.build(lines_vehicle);
  take_samples();
  pairs_.clear();
  match_ = Match{};
  match_.pose = guess;
  match_.covariance = guess_covariance;
  // Keeps a guess that claims to be exact (zero covariance) solvable.
  const Eigen::Matrix3d floor = Eigen::Vector3d(1e-10, 1e-10, 1e-12).asDiagonal();
  const Eigen::Matrix3d prior = (guess_covariance + floor).ldlt().solve(Eigen::Matrix3d::Identity());

  Sums sums;
  bool converged = false;
  double gate_m = start_gate_m(guess_covariance), pairing_gate_m = 0;
  double small_step_m = kSmallStep_m, moved_since_pairing_m = 0;
  while (match_.iteration_count < config_.max_iterations && !converged) {
    const bool fine = gate_m <= config_.last_gate_m;
    if (gate_m != pairing_gate_m || moved_since_pairing_m > kPairAgain_m) {
      pair_up(match_.pose, gate_m, fine);
      pairing_gate_m = gate_m;
      moved_since_pairing_m = 0;
    }
    if (pairs_.size() < kFewestPairs) break;
    ++match_.iteration_count;
    sums = sum_up(match_.pose, kRobustShare * gate_m);
    leave_out_unobservable(sums);
    const Eigen::Vector3d off_guess(match_.pose.x_m - guess.x_m, match_.pose.y_m - guess.y_m,
                                    wrap_rad(match_.pose.theta_rad - guess.theta_rad));
    const Eigen::Vector3d step = -(sums.H + prior).ldlt().solve(sums.g + prior * off_guess);
    match_.pose = {match_.pose.x_m + step.x(), match_.pose.y_m + step.y(), wrap_rad(match_.pose.theta_rad + step.z())};
    const double moved_m = step.head<2>().norm() + std::abs(step.z()) * samples_radius_m_;
    moved_since_pairing_m += moved_m;
    converged = fine && moved_m < small_step_m;
    // Pairs at the ends of lines may alternate for ever by millimetres: each fine step asks for less.
    if (fine) small_step_m *= 1.5;
    // While the lines still move by much of the gate, a narrower one would lose the right pairs.
    if (moved_m < 0.5 * gate_m) gate_m = std::max(config_.last_gate_m, kShrink * gate_m);
  }

  match_.pair_count = static_cast<int>(pairs_.size());
  double paired_m = 0;
  for (const Pair& pair : pairs_) paired_m += pair.length_m;
  match_.verdict = judge(sums, paired_m, guess, converged);
  if (!match_.usable()) {
    match_.pose = guess;
    return match_;
  }
  // Lines that fit worse than their sigmas say are trusted less; better than claimed is luck.
  match_.information = sums.H / std::max(1.0, sums.normed_squares / sums.robust);
  match_.covariance = (match_.information + prior).ldlt().solve(Eigen::Matrix3d::Identity());
  return match_;
}

}  // namespace roadvec
