#pragma once

#include <limits>
#include <vector>

#include "tools/simulate/movers.h"
#include "tools/simulate/scenery.h"

namespace roadvec {

/// All that a beam can meet: what stands still, before and after the scene's one change, and what moves.
class World {
 public:
  /// `sceneries`: one, or two if the scene changes at change_s.
  World(std::vector<Scenery> sceneries, double change_s, Movers movers, std::size_t face_count)
      : sceneries_(std::move(sceneries)), change_s_(change_s), movers_(std::move(movers)), face_count_(face_count) {}

  /// First surface along a beam that leaves at a time after the drive's start. `direction` is a unit vector.
  [[nodiscard]] Hit cast(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double range_m,
                         double time_s = 0) const {
    const Beam beam{origin_m, direction};
    Hit moving{range_m, 0, Material::road, Hit::kNothing};
    movers_.cast(beam, range_m, time_s, moving);
    const Hit still = scenery(time_s).cast(beam, moving.range_m);
    return still.face == Hit::kNothing ? moving : still;
  }

  /// Height of the ground at a point, without what stands on it.
  [[nodiscard]] double height_at(const Eigen::Vector2d& point_m, double time_s = 0) const {
    return scenery(time_s).height_at(point_m);
  }
  [[nodiscard]] const Scenery& scenery(double time_s) const {
    return sceneries_[time_s < change_s_ ? 0 : sceneries_.size() - 1];
  }
  [[nodiscard]] const Movers& movers() const { return movers_; }
  /// Pieces of true boundary that a Hit may name.
  [[nodiscard]] std::size_t face_count() const { return face_count_; }

 private:
  std::vector<Scenery> sceneries_;
  double change_s_;
  Movers movers_;
  std::size_t face_count_;
};

}  // namespace roadvec
