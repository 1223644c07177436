#pragma once

#include "tools/simulate/car_motion.h"

namespace roadvec {

/// The body on its springs: height, pitch and roll, each a damped oscillator about what the ground under the four
/// wheels and the acceleration ask for. The dampers work between body and wheels, so a steady climb leaves nothing
/// behind.
class CarBody {
 public:
  /// At rest on the ground under the car.
  CarBody(const CarSpec& car, const GroundHeight& ground, const Pose2& pose);

  /// On by CarMotion::kStep_s, with the motion that `state` has; writes the body's part of it.
  void step(CarState& state);
  /// Of the ground under the wheels: how much of a way along it is seen from above.
  [[nodiscard]] double level_share() const;

 private:
  struct Spring {
    double value = 0, rate = 0, acceleration = 0;
    double ground = 0, ground_rate = 0;
    double seen = 0;  ///< the ground when it was last looked at
    void step(double push);
    void see(double now);
  };
  void look_at_ground(const Pose2& pose);

  const CarSpec& car_;
  const GroundHeight& ground_;
  Spring height_, pitch_, roll_;  ///< height: of the middle between the axles
  int steps_to_look_ = 0;
};

}  // namespace roadvec
