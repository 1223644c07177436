#pragma once

#include <span>
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

  struct Place {
    Eigen::Vector2d centre_m, ahead, gradient;
    double height_m = 0;
  };
  /// One of them at some time.
  struct Placed {
    std::uint32_t mover = 0;
    Place place;
  };
  /// Those that are there at a time, and within reach of a place.
  void find(double time_s, const Eigen::Vector2d& eye_m, double reach_m, std::vector<Placed>& placed) const;
  /// The first surface of each beam from a range on and before that of its hit, which stays if there is none.
  void cast(std::span<const Placed> placed, std::span<const Beam> beams, double from_m, std::span<Hit> hits) const;

  struct Outline {
    Eigen::Vector2d centre_m, ahead;
    double half_length_m = 0, half_width_m = 0;
  };
  /// All that are there at a time, seen from above.
  [[nodiscard]] std::vector<Outline> at(double time_s) const;

 private:
  struct Mover {
    MoverSpec spec;
    double length_m = 0;        ///< of its line
    std::vector<Place> places;  ///< every kStep_m of it
    std::vector<Box> boxes;     ///< standing at the origin, headed along x
    double reach_m = 0;         ///< no part of it is farther from its centre
  };
  static constexpr double kStep_m = 0.25;

  /// False if it is not there at that time.
  [[nodiscard]] static bool place_at(const Mover& mover, double time_s, Place& place);
  void list_by_second();

  std::vector<Mover> movers_;
  std::vector<std::vector<std::uint32_t>> by_second_;  ///< who is there; the last entry holds for all later times
};

}  // namespace roadvec
