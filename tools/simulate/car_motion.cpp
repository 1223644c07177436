#include "tools/simulate/car_motion.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/angle.h"
#include "tools/simulate/car_body.h"

namespace roadvec {
namespace {

constexpr double kLongestDrive_s = 3 * 3600;
constexpr double kSpeedLag_s = 0.4;           ///< of driver and engine
constexpr double kSteeringLag_s = 0.08;       ///< of driver and gear
constexpr double kSteeringSpeed_radps = 0.6;  ///< of the front wheels, at most
constexpr double kProfileStep_m = 0.5;

/// Speed allowed at each half metre: what the curves bear, and what the brakes can still bring down to it.
std::vector<double> speed_limits_mps(const CarSpec& car, const RoadPath& path) {
  const auto count = static_cast<std::size_t>(car.distance_m / kProfileStep_m) + 2;
  std::vector<double> limits_mps(count, 0.0);
  for (std::size_t i = count - 1; i-- > 0;) {
    const double station_m = car.start_m + static_cast<double>(i) * kProfileStep_m;
    const double k = path.at(station_m).curvature_1pm;
    const double lane_k = k / std::max(0.1, 1 - car.lane_m * k);
    const double curve_mps = k == 0 ? car.speed_mps : std::sqrt(car.side_acceleration_mps2 / std::abs(lane_k));
    const double brake_mps =
        std::sqrt(limits_mps[i + 1] * limits_mps[i + 1] + 2 * 0.8 * car.acceleration_mps2 * kProfileStep_m);
    limits_mps[i] = std::min({car.speed_mps, curve_mps, brake_mps});
  }
  return limits_mps;
}

class Driver {
 public:
  Driver(const CarSpec& car, const RoadPath& path, const GroundHeight& ground)
      : car_(car),
        path_(path),
        limits_mps_(speed_limits_mps(car, path)),
        state_(at_start(car, path)),
        body_(car, ground, state_.pose),
        station_m_(car.start_m) {
    body_.step(state_);
  }

  [[nodiscard]] const CarState& state() const { return state_; }
  [[nodiscard]] bool arrived() const { return left_m() < 0.05 || (left_m() < 1.0 && state_.speed_mps < 0.02); }
  [[nodiscard]] double left_m() const { return car_.start_m + car_.distance_m - station_m_; }

  /// One millisecond on. A car that is held comes to a halt and stands.
  void step(bool held) {
    const double dt = CarMotion::kStep_s;
    const CarState before = state_;
    const double halt_mps2 = before.speed_mps > 0 ? -car_.acceleration_mps2 : 0.0;
    const double most_mps2 = car_.jerk_mps3 * dt;
    state_.acceleration_mps2 +=
        std::clamp((held ? halt_mps2 : wanted_acceleration_mps2()) - before.acceleration_mps2, -most_mps2, most_mps2);
    state_.speed_mps = before.speed_mps + state_.acceleration_mps2 * dt;
    if (state_.speed_mps <= 0) state_.speed_mps = state_.acceleration_mps2 = 0;
    steer(dt);
    turn(before, dt);
    body_.step(state_);
    follow_station();
  }

 private:
  static CarState at_start(const CarSpec& car, const RoadPath& path) {
    const Eigen::Vector2d start_m = path.beside(car.start_m, car.lane_m);
    CarState state;
    state.pose = {start_m.x(), start_m.y(), path.at(car.start_m).heading_rad};
    return state;
  }

  /// The single-track car with its slip; `before` is the state a step ago.
  void turn(const CarState& before, double dt) {
    const double v = state_.speed_mps;
    state_.yaw_rate_radps =
        v * std::tan(state_.steering_rad) / (car_.wheelbase_m + car_.understeer_rad_per_mps2 * v * v);
    state_.side_speed_mps = -car_.rear_slip_rad_per_mps2 * v * state_.yaw_rate_radps * v;
    state_.side_acceleration_mps2 = (state_.side_speed_mps - before.side_speed_mps) / dt + v * state_.yaw_rate_radps;
    const double turned_rad = (before.yaw_rate_radps + state_.yaw_rate_radps) / 2 * dt;
    const double ahead_m = (before.speed_mps + v) / 2 * dt * body_.level_share();
    const double left_m = (before.side_speed_mps + state_.side_speed_mps) / 2 * dt;
    const double c = std::cos(turned_rad / 2), s = std::sin(turned_rad / 2);
    state_.pose = state_.pose * Pose2{ahead_m * c - left_m * s, ahead_m * s + left_m * c, turned_rad};
  }

  /// Brings the speed to its limit as fast as acceleration and jerk allow, and without going beyond.
  [[nodiscard]] double wanted_acceleration_mps2() const {
    const double look_s = 0.2 + car_.acceleration_mps2 / (2 * car_.jerk_mps3);
    const double at = std::max(0.0, station_m_ + state_.speed_mps * look_s - car_.start_m) / kProfileStep_m;
    const auto i = std::min(static_cast<std::size_t>(at), limits_mps_.size() - 2);
    const double share = std::min(1.0, at - static_cast<double>(i));
    // Creep over the last centimetres instead of standing still before the end.
    const double limit_mps = std::max(0.1, std::lerp(limits_mps_[i], limits_mps_[i + 1], share));
    const double off_mps = limit_mps - state_.speed_mps, j = car_.jerk_mps3;
    const double soft_mps = j * kSpeedLag_s * kSpeedLag_s;  // from here on the jerk of an even decay is allowed
    const double size_mps2 = std::abs(off_mps) < soft_mps ? std::abs(off_mps) / kSpeedLag_s
                                                          : std::sqrt(2 * j * (std::abs(off_mps) - soft_mps / 2));
    return std::copysign(std::min(size_mps2, car_.acceleration_mps2), off_mps);
  }

  void steer(double dt) {
    const double ahead_m = std::max(4.0, 0.7 * state_.speed_mps);
    const Eigen::Vector2d target = state_.pose.inverse() * path_.beside(station_m_ + ahead_m, car_.lane_m);
    const double curvature_1pm = 2 * target.y() / target.squaredNorm(), v = state_.speed_mps;
    const double wanted_rad = std::atan((car_.wheelbase_m + car_.understeer_rad_per_mps2 * v * v) * curvature_1pm);
    const double most_rad = kSteeringSpeed_radps * dt;
    state_.steering_rad += std::clamp((wanted_rad - state_.steering_rad) * dt / kSteeringLag_s, -most_rad, most_rad);
  }

  /// Keeps station_m_ where the centre line is nearest to the car.
  void follow_station() {
    const PathPoint road = path_.at(station_m_);
    const Eigen::Vector2d off = state_.pose.translation() - road.position_m;
    const Eigen::Vector2d along(std::cos(road.heading_rad), std::sin(road.heading_rad));
    const double left_m = along.x() * off.y() - along.y() * off.x();
    station_m_ += along.dot(off) / std::max(0.1, 1 - left_m * road.curvature_1pm);
  }

  const CarSpec& car_;
  const RoadPath& path_;
  std::vector<double> limits_mps_;
  CarState state_;
  CarBody body_;
  double station_m_ = 0;
};

}  // namespace

Eigen::Isometry3d CarState::T_scene_vehicle() const {
  using Axis = Eigen::AngleAxisd;
  return Eigen::Translation3d(pose.x_m, pose.y_m, z_m) *
         (Axis(pose.theta_rad, Eigen::Vector3d::UnitZ()) * Axis(pitch_rad, Eigen::Vector3d::UnitY()) *
          Axis(roll_rad, Eigen::Vector3d::UnitX()));
}

CarState CarMotion::at(double time_s) const {
  const double at = std::clamp(time_s / kStep_s, 0.0, static_cast<double>(states_.size() - 1));
  const auto i = std::min(static_cast<std::size_t>(at), states_.size() - 2);
  const double share = at - static_cast<double>(i);
  const CarState &a = states_[i], &b = states_[i + 1];
  CarState state;
  for (double CarState::*field :
       {&CarState::speed_mps, &CarState::acceleration_mps2, &CarState::side_speed_mps,
        &CarState::side_acceleration_mps2, &CarState::steering_rad, &CarState::yaw_rate_radps, &CarState::z_m,
        &CarState::pitch_rad, &CarState::roll_rad, &CarState::pitch_radps, &CarState::roll_radps, &CarState::z_mps2}) {
    state.*field = a.*field + share * (b.*field - a.*field);
  }
  state.pose = {a.pose.x_m + share * (b.pose.x_m - a.pose.x_m), a.pose.y_m + share * (b.pose.y_m - a.pose.y_m),
                wrap_rad(a.pose.theta_rad + share * wrap_rad(b.pose.theta_rad - a.pose.theta_rad))};
  return state;
}

Expected<CarMotion> drive(const CarSpec& car, const RoadPath& path, const GroundHeight& ground) {
  const double end_m = car.start_m + car.distance_m;
  if (!path.closed() && end_m > path.length_m()) {
    return fail("car.distance_m: the car would leave the road's end at " + std::to_string(path.length_m()) +
                " m; shorten the distance or lengthen the road");
  }
  Driver driver(car, path, ground);
  std::vector<CarState> states{driver.state()};
  const auto hold = [&](double for_s) {
    for (long i = std::lround(for_s / CarMotion::kStep_s); i-- > 0;) {
      driver.step(true);
      states.push_back(driver.state());
    }
  };
  hold(car.wait_s);
  while (!driver.arrived() || driver.state().speed_mps > 0) {
    driver.step(driver.arrived());
    states.push_back(driver.state());
    if (static_cast<double>(states.size()) * CarMotion::kStep_s > kLongestDrive_s) {
      return fail("car: the drive takes more than three hours; shorten car.distance_m or raise car.speed_mps");
    }
  }
  hold(std::max(car.wait_s, 0.01));
  return CarMotion(std::move(states));
}

}  // namespace roadvec
