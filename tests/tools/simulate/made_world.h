#pragma once

#include <stdexcept>
#include <string>

#include "tools/simulate/scene_file.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {

/// The world of a scene's text.
[[nodiscard]] inline BuiltWorld world_of(const std::string& text) {
  auto scene = parse_scene(text, "made.toml");
  if (!scene) throw std::runtime_error(scene.error().message);
  auto built = build_world(*scene);
  if (!built) throw std::runtime_error(built.error().message);
  return std::move(*built);
}

/// A straight road to the east, 8 m wide, x from 0 to 100: flat, its kerbs sharp, nothing rough. Tables of the road may
/// follow.
inline const std::string kFlatRoad = R"(
roughness_m = {road = 0, grass = 0, sidewalk = 0}
[[road]]
waypoints = [[0, 0], [100, 0]]
width_m = 8
crown_percent = 0
kerb_round_m = 0
sidewalk_percent = 0
)";

/// From one place towards another.
[[nodiscard]] inline Hit cast(const World& world, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                              double time_s = 0) {
  return world.cast(from, (to - from).normalized(), 100, time_s);
}

}  // namespace roadvec
