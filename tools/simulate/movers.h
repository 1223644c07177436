#pragma once

#include <vector>

#include "core/base/error.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/scenery.h"

namespace roadvec {

/// The boxes that a car, parked or not, is made of, at its place on the ground: body, cabin, wheels. Beams pass below
/// the body, between the wheels. The body comes first.
[[nodiscard]] std::vector<Box> car_boxes(const Eigen::Vector2d& centre_m, const Eigen::Vector2d& ahead, double length_m,
                                         double width_m, double height_m);

/// Cars, cyclists and pedestrians under way.
class Movers {
 public:
  /// Fails on a line that cannot be followed.
  [[nodiscard]] static Expected<Movers> create(const std::vector<MoverSpec>& specs, const Scenery& scenery);

  /// The nearest of them that the beam meets before `range_m`.
  void cast(const Beam& beam, double range_m, double time_s, Hit& hit) const;

  struct Outline {
    Eigen::Vector2d centre_m, ahead;
    double half_length_m = 0, half_width_m = 0;
  };
  /// All that are there at a time, seen from above.
  [[nodiscard]] std::vector<Outline> at(double time_s) const;

 private:
  struct Place {
    Eigen::Vector2d centre_m, ahead, gradient;
    double height_m = 0;
  };
  struct Mover {
    MoverSpec spec;
    double length_m = 0;        ///< of its line
    std::vector<Place> places;  ///< every kStep_m of it
    std::vector<Box> boxes;     ///< standing at the origin, headed along x
    double reach_m = 0;         ///< no part of it is farther from its centre
  };
  static constexpr double kStep_m = 0.25;

  /// False if it is not there at that time.
  [[nodiscard]] static bool find(const Mover& mover, double time_s, Place& place);
  void list_by_second();

  std::vector<Mover> movers_;
  std::vector<std::vector<std::uint32_t>> by_second_;  ///< who is there; the last entry holds for all later times
};

}  // namespace roadvec
