#include "core/odometry/odometry.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/base/square.h"

namespace roadvec {
namespace {

constexpr double kStandingSpeed_mps = 0.02;
constexpr double kStandingTime_s = 0.5;  // wheels report zero a moment before the body stops rocking
constexpr double kStandingGyroSigma_radps = 0.005;
// Wheels of coarse CAN signals report zero up to half a step: a car that turns faster than this is moving all the same.
constexpr double kStandingYawRate_radps = 0.02;
constexpr double kStandingNoise = 0.01;  // of what is usual: a car that stands neither moves nor turns
// Without wheel speed the last seen motion goes on: how fast it may change, per root second. City traffic brakes at 3
// m/s2.
constexpr double kCoastingSpeedNoise_mps = 1.0;
constexpr double kCoastingYawNoise_radps = 0.2;
constexpr double kSteeringYawNoise_radps = 0.02;
// A match is made against a local map that the same path drew, and what misleads it, a rounded car or a bend, is seen
// from nearly the same place in the next sweep: one match is worth less than its residuals say, and matches tell
// something new only as the car moves on.
constexpr double kMatchFloor_m = 0.01;
constexpr double kMatchFloor_rad = 0.0005;
constexpr double kMatchCorrelation_m = 10.0;  // measured: 5 to 20 m give a third of the heading's drift without it
constexpr double kLeastMatchShare = 0.02;     // while the car stands
// In a turn the bicycle model is off by its tyres' slip, a share of the yaw rate [Rajamani2012], and the compass by
// what iron in the car does to it, which turns with the car.
constexpr double kSteeringSlip = 0.5;
constexpr double kSoftIron_rad = 0.03;  // per root radian turned: 1-2 deg of soft-iron error
constexpr double kLeastLevel = 0.9;     // no street is steeper than 25 deg: an IMU that says so is not believed
constexpr double kBiasWalk_radps = 2e-5, kScaleWalk = 1e-4, kSteerWalk_rad = 2e-5;  // per root second
// Longer than between any two samples of a car that is listened to, and later than any comes.
constexpr double kJump_s = 2.0;
constexpr double kJumpSigma_m = 1.0, kJumpSigma_rad = 0.05;  // choice: a match finds the way from there
// Drift of the local map per metre driven, which no match against it can see.
constexpr double kLocalMapDrift = 0.002;
constexpr double kLocalMapDrift_radpm = 0.00005;

}  // namespace

Odometry::Odometry(const OdometryConfig& config, const VehicleGeometry& vehicle) : config_(config), vehicle_(vehicle) {
  covariance_(kBias, kBias) = config.gyro_bias_sigma_radps * config.gyro_bias_sigma_radps;
  covariance_(kScale, kScale) = config.speed_scale_sigma * config.speed_scale_sigma;
  covariance_(kSteer, kSteer) = config.steering_offset_sigma_rad * config.steering_offset_sigma_rad;
  covariance_(kCompass, kCompass) = kPi * kPi;
}

const Path& Odometry::integrate(std::span<const MotionSample> motion, SensorTime start, SensorTime end) noexcept {
  const bool starts = !started_;  // on samples from long before
  if (starts) {
    started_ = true;
    time_ = corrected_time_ = start;
  }
  path_.clear();
  path_.push(time_, pose());
  for (const MotionSample& sample : motion) {
    if (!starts && is_jump(sample.time)) jump_to(sample.time);
    predict_to(sample.time);
    take(sample);
  }
  if (is_jump(end)) jump_to(end);
  predict_to(end);
  return path_;
}

bool Odometry::is_jump(SensorTime time) const noexcept { return std::abs(seconds_between(time_, time)) > kJump_s; }

/// What was seen keeps its age: a clock that is set makes no sensor silent.
void Odometry::jump_to(SensorTime time) noexcept {
  const std::int64_t step_ns = time - time_;
  for (std::optional<SensorTime>* seen :
       {&wheels_seen_, &steering_seen_, &gyro_seen_, &heading_seen_, &standing_since_}) {
    if (*seen) *seen = **seen + step_ns;
  }
  corrected_time_ = corrected_time_ + step_ns;
  time_ = time;
  const Eigen::Vector3d noise(kJumpSigma_m * kJumpSigma_m, kJumpSigma_m * kJumpSigma_m,
                              kJumpSigma_rad * kJumpSigma_rad);
  covariance_.diagonal().head<3>() += noise;
  relative_covariance_.diagonal() += noise;
  path_.clear();
  path_.push(time_, pose());
}

void Odometry::predict_to(SensorTime time) noexcept {
  const double dt_s = seconds_between(time_, time);
  if (dt_s <= 0) return;
  choose_inputs();
  const double v = speed_mps();
  const double mid_rad = state_[kTheta] + 0.5 * yaw_rate_radps_ * dt_s;
  const double c = std::cos(mid_rad), s = std::sin(mid_rad);

  StateCovariance jacobian = StateCovariance::Identity();
  jacobian(kX, kTheta) = -v * dt_s * s;
  jacobian(kY, kTheta) = v * dt_s * c;
  jacobian(kX, kScale) = level_ * speed_mps_ * dt_s * c;
  jacobian(kY, kScale) = level_ * speed_mps_ * dt_s * s;
  double yaw_noise = kCoastingYawNoise_radps;
  if (yaw_source_ == MotionSource::imu) {
    if (!still_) jacobian(kTheta, kBias) = -dt_s;
    yaw_noise = config_.gyro_noise_radps;
  } else if (yaw_source_ == MotionSource::steering) {
    const double road_wheel_rad = road_wheel_rad_ + state_[kSteer];
    const double cosine = std::cos(road_wheel_rad);
    jacobian(kTheta, kSteer) = dt_s * v / (vehicle_.wheelbase_m * cosine * cosine);
    yaw_noise = kSteeringYawNoise_radps;
  }
  const double speed_noise = speed_source_ == MotionSource::wheels ? config_.speed_noise_mps : kCoastingSpeedNoise_mps;
  // The car does not slide sideways, but the rear axle is not exactly where the mounting says: a tenth of the speed's
  // noise.
  const double along2 = speed_noise * speed_noise * dt_s, across2 = 0.01 * along2;
  PoseCovariance noise = PoseCovariance::Zero();
  noise(0, 0) = c * c * along2 + s * s * across2;
  noise(1, 1) = s * s * along2 + c * c * across2;
  noise(0, 1) = noise(1, 0) = c * s * (along2 - across2);
  noise(2, 2) = yaw_noise * yaw_noise * dt_s;

  if (still_) noise *= kStandingNoise * kStandingNoise;

  covariance_ = (jacobian * covariance_ * jacobian.transpose()).eval();
  covariance_.topLeftCorner<3, 3>() += noise;
  covariance_(kBias, kBias) += kBiasWalk_radps * kBiasWalk_radps * dt_s;
  covariance_(kScale, kScale) += kScaleWalk * kScaleWalk * dt_s;
  covariance_(kSteer, kSteer) += kSteerWalk_rad * kSteerWalk_rad * dt_s;
  covariance_(kCompass, kCompass) += (config_.heading_wander_rad * config_.heading_wander_rad +
                                      kSoftIron_rad * kSoftIron_rad * std::abs(yaw_rate_radps_)) *
                                     dt_s;

  const double distance_m = std::abs(v) * dt_s;
  const Eigen::Matrix3d pose_jacobian = jacobian.topLeftCorner<3, 3>();
  relative_covariance_ = (pose_jacobian * relative_covariance_ * pose_jacobian.transpose()).eval() + noise;
  relative_covariance_.diagonal() += Eigen::Vector3d(kLocalMapDrift * kLocalMapDrift, kLocalMapDrift * kLocalMapDrift,
                                                     kLocalMapDrift_radpm * kLocalMapDrift_radpm) *
                                     distance_m;

  state_[kX] += v * dt_s * c;
  state_[kY] += v * dt_s * s;
  state_[kTheta] = wrap_rad(state_[kTheta] + yaw_rate_radps_ * dt_s);
  time_ = time;
  path_.push(time_, pose());
}

void Odometry::choose_inputs() noexcept {
  if (fresh(wheels_seen_)) {
    speed_source_ = MotionSource::wheels;
  } else {
    speed_source_ = corrected_pose_ ? MotionSource::matching : MotionSource::none;
    speed_mps_ = corrected_speed_mps_ / (level_ * (1 + state_[kScale]));
  }
  if (fresh(gyro_seen_)) {
    yaw_source_ = MotionSource::imu;
    yaw_rate_radps_ = gyro_radps_ - state_[kBias];
  } else if (fresh(steering_seen_) && speed_source_ != MotionSource::none) {
    yaw_source_ = MotionSource::steering;
    yaw_rate_radps_ = speed_mps() * std::tan(road_wheel_rad_ + state_[kSteer]) / vehicle_.wheelbase_m;
  } else {
    yaw_source_ = corrected_pose_ ? MotionSource::matching : MotionSource::none;
    yaw_rate_radps_ = corrected_yaw_rate_radps_;
  }
  still_ = speed_source_ == MotionSource::wheels && std::abs(speed_mps_) <= kStandingSpeed_mps && !turning();
  if (still_) yaw_rate_radps_ = 0;
}

void Odometry::take(const MotionSample& sample) noexcept {
  if (const auto* wheels = std::get_if<WheelSpeed>(&sample.value)) take(sample.time, *wheels);
  if (const auto* steering = std::get_if<SteeringAngle>(&sample.value)) take(sample.time, *steering);
  if (const auto* imu = std::get_if<ImuSample>(&sample.value)) take(sample.time, *imu);
}

void Odometry::take(SensorTime time, const WheelSpeed& wheels) noexcept {
  speed_mps_ = 0.5 * (wheels.rear_left_mps + wheels.rear_right_mps);
  wheels_seen_ = time;
  if (std::abs(speed_mps_) > kStandingSpeed_mps)
    standing_since_.reset();
  else if (!standing_since_)
    standing_since_ = time;
}

void Odometry::take(SensorTime time, const SteeringAngle& steering) noexcept {
  road_wheel_rad_ = steering.wheel_rad / vehicle_.steering_ratio;
  steering_seen_ = time;
  if (!fresh(gyro_seen_) || !fresh(wheels_seen_) || speed_mps_ < 1.0) return;
  // v tan(delta + offset) / L = gyro - bias [He2018, III-A-1]: what steering says of the yaw rate.
  const double angle_rad = road_wheel_rad_ + state_[kSteer], cosine = std::cos(angle_rad);
  const double residual = (gyro_radps_ - state_[kBias]) - speed_mps() * std::tan(angle_rad) / vehicle_.wheelbase_m;
  StateVector jacobian = StateVector::Zero();
  jacobian[kBias] = 1;
  jacobian[kScale] = level_ * speed_mps_ * std::tan(angle_rad) / vehicle_.wheelbase_m;
  jacobian[kSteer] = speed_mps() / (vehicle_.wheelbase_m * cosine * cosine);
  update(jacobian, residual, square(config_.steering_yaw_rate_sigma_radps) + square(kSteeringSlip * gyro_radps_));
}

void Odometry::take(SensorTime time, const ImuSample& imu) noexcept {
  if (imu.has_rate) {
    // Heading turns about the vertical, the gyro about the vehicle's axis: 0.3 % apart on a hill of 8 %.
    gyro_radps_ = imu.has_orientation
                      ? (imu.rate_y_radps * std::sin(imu.roll_rad) + imu.rate_z_radps * std::cos(imu.roll_rad)) /
                            std::max(std::cos(imu.pitch_rad), kLeastLevel)
                      : imu.rate_z_radps;
    gyro_seen_ = time;
    if (standing() && !turning()) {
      StateVector jacobian = StateVector::Zero();
      jacobian[kBias] = 1;
      update(jacobian, gyro_radps_ - state_[kBias], kStandingGyroSigma_radps * kStandingGyroSigma_radps);
    }
  }
  if (imu.has_orientation) {
    level_ = std::max(std::cos(imu.pitch_rad), kLeastLevel);
    heading_seen_ = time;
    StateVector jacobian = StateVector::Zero();
    jacobian[kTheta] = jacobian[kCompass] = 1;
    const double residual = wrap_rad(imu.heading_rad - state_[kTheta] - state_[kCompass]);
    update(jacobian, residual, config_.heading_sigma_rad * config_.heading_sigma_rad);
  }
}

void Odometry::correct(const Pose2& T_odom_vehicle, const Eigen::Matrix3d& information) noexcept {
  const Pose2 now = pose();
  correct(information * Eigen::Vector3d(T_odom_vehicle.x_m - now.x_m, T_odom_vehicle.y_m - now.y_m,
                                        wrap_rad(T_odom_vehicle.theta_rad - now.theta_rad)),
          information);
}

void Odometry::correct(const Eigen::Vector3d& information_vector, const Eigen::Matrix3d& information) noexcept {
  const Pose2 before = pose();
  const double moved_m = corrected_pose_ ? (before.translation() - corrected_pose_->translation()).norm() : 0.0;
  const double share = std::clamp(moved_m / kMatchCorrelation_m, kLeastMatchShare, 1.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(information);
  for (int k = 0; k < 3; ++k) {
    if (eigen.eigenvalues()[k] <= 1e-3) continue;  // not observed
    const Eigen::Vector3d axis = eigen.eigenvectors().col(k);
    const double floor2 = kMatchFloor_m * kMatchFloor_m * axis.head<2>().squaredNorm() +
                          kMatchFloor_rad * kMatchFloor_rad * axis[2] * axis[2];
    const double variance = 1.0 / (share * eigen.eigenvalues()[k]) + floor2;
    const Eigen::Vector3d moved(state_[kX] - before.x_m, state_[kY] - before.y_m,
                                wrap_rad(state_[kTheta] - before.theta_rad));
    StateVector jacobian = StateVector::Zero();
    jacobian.head<3>() = axis;
    update(jacobian, axis.dot(information_vector) / eigen.eigenvalues()[k] - axis.dot(moved), variance);
    const Eigen::Vector3d gain = relative_covariance_ * axis / (axis.dot(relative_covariance_ * axis) + variance);
    relative_covariance_ -= (gain * (axis.transpose() * relative_covariance_)).eval();
  }
  const double dt_s = seconds_between(corrected_time_, time_);
  if (corrected_pose_ && dt_s > 0) {
    const Pose2 moved = corrected_pose_->inverse() * pose();
    corrected_speed_mps_ = moved.x_m / dt_s;
    corrected_yaw_rate_radps_ = moved.theta_rad / dt_s;
  }
  corrected_pose_ = pose();
  corrected_time_ = time_;
}

void Odometry::update(const StateVector& jacobian, double residual, double variance) noexcept {
  const StateVector gain_numerator = covariance_ * jacobian;
  const StateVector gain = gain_numerator / (jacobian.dot(gain_numerator) + variance);
  state_ += gain * residual;
  state_[kTheta] = wrap_rad(state_[kTheta]);
  covariance_ -= (gain * gain_numerator.transpose()).eval();
  covariance_ =
      (0.5 * (covariance_ + covariance_.transpose())).eval();  // rounding must not make it lopsided over hours
}

PoseCovariance Odometry::relative_covariance() const noexcept {
  const double c = std::cos(relative_start_.theta_rad), s = std::sin(relative_start_.theta_rad);
  Eigen::Matrix3d rotation;
  rotation << c, s, 0, -s, c, 0, 0, 0, 1;
  return rotation * relative_covariance_ * rotation.transpose();
}

bool Odometry::fresh(const std::optional<SensorTime>& seen) const noexcept {
  return seen && seconds_between(*seen, time_) <= config_.input_timeout_s;
}

bool Odometry::turning() const noexcept {
  const double bias_sigma_radps = std::sqrt(covariance_(kBias, kBias));
  return std::abs(gyro_radps_ - state_[kBias]) > std::max(kStandingYawRate_radps, 3 * bias_sigma_radps);
}

bool Odometry::standing() const noexcept {
  return standing_since_ && fresh(wheels_seen_) && seconds_between(*standing_since_, time_) > kStandingTime_s;
}

}  // namespace roadvec
