#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/base/time.h"
#include "core/geometry/path.h"
#include "core/geometry/pose2.h"
#include "core/sensor/motion.h"

namespace roadvec {

struct OdometryConfig {
  double speed_noise_mps = 0.05;                ///< wheel slip and quantisation, per root second; choice
  double speed_scale_sigma = 0.02;              ///< tyre radius: 1-2 % between new and worn (choice)
  double gyro_noise_radps = 0.0002;             ///< 0.01 deg/s per root hertz [XsensMTi100]
  double gyro_bias_sigma_radps = 0.002;         ///< at start-up; 0.05-0.1 deg/s is usual for a MEMS gyro
  double steering_offset_sigma_rad = 0.01;      ///< at the road wheel; 0.5 deg: a usual misalignment
  double steering_yaw_rate_sigma_radps = 0.05;  ///< bicycle model against the truth, one sample
  double heading_sigma_rad = 0.02;              ///< compass, one sample, without its slow wander
  double heading_wander_rad = 0.005;            ///< slow wander of the compass, per root second
  double input_timeout_s = 0.5;                 ///< a sensor older than this no longer drives the prediction
};
template <class Visitor>
void visit_fields(OdometryConfig& c, Visitor&& field) {
  field("odometry.speed_noise_mps", c.speed_noise_mps, 0.001, 5.0, "noise of the wheel speed, per root second");
  field("odometry.speed_scale_sigma", c.speed_scale_sigma, 0.0, 0.2,
        "how wrong the wheel speed's scale may be at start");
  field("odometry.gyro_noise_radps", c.gyro_noise_radps, 0.00001, 1.0, "noise of the yaw rate, per root second");
  field("odometry.gyro_bias_sigma_radps", c.gyro_bias_sigma_radps, 0.0, 0.1, "how large the gyro bias may be at start");
  field("odometry.steering_offset_sigma_rad", c.steering_offset_sigma_rad, 0.0, 0.2,
        "how far the steering may be off centre at start, at the road wheel");
  field("odometry.steering_yaw_rate_sigma_radps", c.steering_yaw_rate_sigma_radps, 0.001, 1.0,
        "error of the yaw rate computed from steering and speed, one sample");
  field("odometry.heading_sigma_rad", c.heading_sigma_rad, 0.001, 3.0, "noise of the IMU's heading, one sample");
  field("odometry.heading_wander_rad", c.heading_wander_rad, 0.0, 1.0,
        "slow wander of the IMU's heading, per root second");
  field("odometry.input_timeout_s", c.input_timeout_s, 0.05, 10.0,
        "age beyond which a motion sensor is taken for silent");
}

/// What the bicycle model needs of the car; no defaults, they are facts of the vehicle.
struct VehicleGeometry {
  double wheelbase_m = 0;
  double track_m = 0;
  double steering_ratio = 0;  ///< steering-wheel angle over road-wheel angle
};

/// Where the yaw rate and the speed came from during the last integrate().
enum class MotionSource : std::uint8_t { none = 0, matching = 1, steering = 2, imu = 3, wheels = 4 };

/// Step 0, odometry: an extended Kalman filter over (x, y, heading, gyro bias, speed scale, steering offset, compass
/// offset) [He2018, III-A-1]. Heading and speed are integrated at every motion sample; the gyro drives the prediction,
/// the yaw rate from steering and the IMU's heading correct it, the match of step 6 corrects the pose.
///
/// Differs from the paper: biases and scales are states, because a steering offset of 0.05 deg at the road wheel
/// already bends a straight road by 0.4 deg per 20 m; an IMU that knows how it is tilted turns the rates and the speed
/// of a hill into the plane. Falls back openly: no IMU: steering drives; no CAN: the motion between the last two
/// corrected poses drives. No allocation, lock or clock; a few hundred flops per sample.
class Odometry {
 public:
  static constexpr int kStates = 7;
  using StateCovariance = Eigen::Matrix<double, kStates, kStates>;

  Odometry(const OdometryConfig& config, const VehicleGeometry& vehicle);

  /// Consumes the samples up to `end` (all not older than those of the last call) and predicts to `end`. Where time
  /// jumps by seconds, a clock was set, or nothing told of the car: the path goes on where it was, with less certainty.
  /// The first call sets the odom frame: the vehicle at its `start`. The path covers [start, end]; valid until the next
  /// call.
  const Path& integrate(std::span<const MotionSample> motion, SensorTime start, SensorTime end) noexcept;

  /// A pose of the vehicle in odom at the end of the last integrate(), with the information (inverse covariance,
  /// singular where a direction was not observed) of that measurement alone.
  void correct(const Pose2& T_odom_vehicle, const Eigen::Matrix3d& information) noexcept;
  /// The same as information * (measured pose - pose()): what is left of a match when the prior it was given is taken
  /// out.
  void correct(const Eigen::Vector3d& information_vector, const Eigen::Matrix3d& information) noexcept;

  [[nodiscard]] Pose2 pose() const noexcept { return {state_[kX], state_[kY], state_[kTheta]}; }
  [[nodiscard]] PoseCovariance pose_covariance() const noexcept { return covariance_.topLeftCorner<3, 3>(); }
  [[nodiscard]] SensorTime time() const noexcept { return time_; }
  [[nodiscard]] double speed_mps() const noexcept { return level_ * speed_mps_ * (1 + state_[kScale]); }
  [[nodiscard]] double yaw_rate_radps() const noexcept { return yaw_rate_radps_; }
  [[nodiscard]] double gyro_bias_radps() const noexcept { return state_[kBias]; }
  [[nodiscard]] double speed_scale() const noexcept { return state_[kScale]; }
  [[nodiscard]] double steering_offset_rad() const noexcept { return state_[kSteer]; }
  [[nodiscard]] MotionSource speed_source() const noexcept { return speed_source_; }
  [[nodiscard]] MotionSource yaw_source() const noexcept { return yaw_source_; }

  /// Starts a new relative covariance: called when a keyframe is taken.
  void begin_relative() noexcept {
    relative_covariance_.setZero();
    relative_start_ = pose();
  }
  /// Of the pose now relative to the pose at begin_relative(), in that pose's frame.
  [[nodiscard]] PoseCovariance relative_covariance() const noexcept;

 private:
  enum : int { kX, kY, kTheta, kBias, kScale, kSteer, kCompass };
  using StateVector = Eigen::Matrix<double, kStates, 1>;

  void take(const MotionSample& sample) noexcept;
  void take(SensorTime time, const WheelSpeed& wheels) noexcept;
  void take(SensorTime time, const SteeringAngle& steering) noexcept;
  void take(SensorTime time, const ImuSample& imu) noexcept;
  void predict_to(SensorTime time) noexcept;
  [[nodiscard]] bool is_jump(SensorTime time) const noexcept;
  void jump_to(SensorTime time) noexcept;
  void choose_inputs() noexcept;
  void update(const StateVector& jacobian, double residual, double variance) noexcept;
  [[nodiscard]] bool fresh(const std::optional<SensorTime>& seen) const noexcept;
  [[nodiscard]] bool standing() const noexcept;
  [[nodiscard]] bool turning() const noexcept;  ///< by the gyro; false without one

  OdometryConfig config_;
  VehicleGeometry vehicle_;
  StateVector state_ = StateVector::Zero();
  StateCovariance covariance_ = StateCovariance::Zero();
  PoseCovariance relative_covariance_ = PoseCovariance::Zero();
  Pose2 relative_start_;
  SensorTime time_;
  bool started_ = false, still_ = false;
  std::optional<SensorTime> wheels_seen_, steering_seen_, gyro_seen_, heading_seen_, standing_since_;
  double speed_mps_ = 0, yaw_rate_radps_ = 0, gyro_radps_ = 0, road_wheel_rad_ = 0;
  double level_ = 1;  ///< metres in the plane per metre driven: less than 1 on a hill
  MotionSource speed_source_ = MotionSource::none, yaw_source_ = MotionSource::none;
  SensorTime corrected_time_;
  std::optional<Pose2> corrected_pose_;
  double corrected_speed_mps_ = 0, corrected_yaw_rate_radps_ = 0;
  Path path_;
};

}  // namespace roadvec
