#pragma once

#include <vector>

#include "core/base/error.h"
#include "tools/simulate/road_path.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// A road of the scene, or the side street at one of its mouths.
struct RoadLine {
  RoadSpec spec;
  RoadPath path;
};

/// A short straight piece of the road's edge. The road lies on its right, what is beside the road on its left.
struct RoadEdge {
  Eigen::Vector2d a_m, b_m;
  double kerb_a_m = 0, kerb_b_m = 0;  ///< height of the kerb at both ends
  double round_m = 0;                 ///< radius of the kerb's upper edge
  double crown = 0, crest_m = 0;      ///< the road rises by `crown` a metre, up to so far from its edge
  double slope = 0;                   ///< of the ground beside the road, outwards
  double near_m = 0;                  ///< so far from the edge reaches `near`, then comes `far`
  Material near = Material::sidewalk, far = Material::grass;
  bool open = false;       ///< a road's end, where the world stops: no boundary
  bool continues = false;  ///< begins where the piece before it ended
};

/// True if a thing marked `when` is there in that phase, 0 before the scene's change and 1 after it.
[[nodiscard]] bool is_there(When when, int phase);

/// The scene's roads in a phase and the side streets at their mouths.
[[nodiscard]] Expected<std::vector<RoadLine>> road_lines(const Scene& scene, int phase);

/// The outline of all roads' areas together: corners rounded where roads meet, bays added, build-outs and islands taken
/// away, cut into pieces of half a metre. What each piece is like comes from the road whose edge lies nearest.
[[nodiscard]] std::vector<RoadEdge> road_edges(const Scene& scene, const std::vector<RoadLine>& lines, int phase);

}  // namespace roadvec
