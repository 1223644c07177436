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

  /// What there is at one time, as far as beams from one place reach.
  struct Moment {
    const Scenery* scenery = nullptr;
    std::vector<Movers::Placed> movers;
  };
  void look(double time_s, const Eigen::Vector2d& eye_m, double reach_m, Moment& moment) const {
    moment.scenery = &scenery(time_s);
    movers_.find(time_s, eye_m, reach_m, moment.movers);
  }
  /// The first surface of each beam from a range on and before that of its hit, which stays if there is none. No beam
  /// strays farther than Scenery::kStray_m from the first one.
  void cast(const Moment& moment, std::span<const Beam> beams, double from_m, std::span<Hit> hits) const {
    movers_.cast(moment.movers, beams, from_m, hits);
    moment.scenery->cast(beams, from_m, hits);
  }
  /// One beam, at a time after the drive's start. `direction` is a unit vector.
  [[nodiscard]] Hit cast(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double range_m,
                         double time_s = 0) const {
    Moment moment;
    look(time_s, origin_m.head<2>(), range_m, moment);
    const Beam beam{origin_m, direction};
    Hit hit{range_m, 0, Material::road, Hit::kNothing};
    cast(moment, {&beam, 1}, 0, {&hit, 1});
    return hit;
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
