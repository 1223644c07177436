#include "tools/simulate/car_body.h"

#include <cmath>

#include "core/base/angle.h"

namespace roadvec {
namespace {

// A passenger car's body on its springs: 1.4 swings a second, dying out within two. [Rajamani2012, ch. 10]
constexpr double kNatural_radps = kTwoPi * 1.4, kDamping = 0.35;

constexpr int kLookEvery = 10;  ///< steps: the ground under a wheel changes slowly

}  // namespace

CarBody::CarBody(const CarSpec& car, const GroundHeight& ground, const Pose2& pose) : car_(car), ground_(ground) {
  look_at_ground(pose);
  for (Spring* spring : {&height_, &pitch_, &roll_}) {
    spring->value = spring->ground;
    spring->ground_rate = 0;
  }
}

void CarBody::Spring::see(double now) {
  ground_rate = (now - seen) / (kLookEvery * CarMotion::kStep_s);
  ground = seen = now;
}

void CarBody::Spring::step(double push) {
  acceleration =
      kNatural_radps * kNatural_radps * (ground + push - value) + 2 * kDamping * kNatural_radps * (ground_rate - rate);
  rate += acceleration * CarMotion::kStep_s;
  value += rate * CarMotion::kStep_s;
}

double CarBody::level_share() const { return std::cos(pitch_.ground); }

void CarBody::look_at_ground(const Pose2& pose) {
  const double side_m = car_.track_m / 2, ahead_m = car_.wheelbase_m;
  const double front_left_m = ground_(pose * Eigen::Vector2d(ahead_m, side_m));
  const double front_right_m = ground_(pose * Eigen::Vector2d(ahead_m, -side_m));
  const double rear_left_m = ground_(pose * Eigen::Vector2d(0, side_m));
  const double rear_right_m = ground_(pose * Eigen::Vector2d(0, -side_m));
  height_.see((front_left_m + front_right_m + rear_left_m + rear_right_m) / 4);
  pitch_.see(std::atan((rear_left_m + rear_right_m - front_left_m - front_right_m) / (2 * ahead_m)));
  roll_.see(std::atan((front_left_m + rear_left_m - front_right_m - rear_right_m) / (2 * car_.track_m)));
}

void CarBody::step(CarState& state) {
  if (steps_to_look_-- == 0) {
    look_at_ground(state.pose);
    steps_to_look_ = kLookEvery - 1;
  }
  height_.step(0);
  pitch_.step(rad_from_deg(-car_.pitch_deg_per_mps2 * state.acceleration_mps2));
  roll_.step(rad_from_deg(car_.roll_deg_per_mps2 * state.side_acceleration_mps2));
  // The body turns about its middle; the rear axle comes up when the nose goes down.
  state.z_m = height_.value + car_.wheelbase_m / 2 * std::sin(pitch_.value);
  state.z_mps2 = height_.acceleration + car_.wheelbase_m / 2 * pitch_.acceleration;
  state.pitch_rad = pitch_.value;
  state.pitch_radps = pitch_.rate;
  state.roll_rad = roll_.value;
  state.roll_radps = roll_.rate;
}

}  // namespace roadvec
