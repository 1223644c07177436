#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

namespace roadvec {

/// Side of the road, seen in the direction of growing station.
enum class Side : std::uint8_t { left, right };

/// What a surface is made of: decides how much light comes back, and how rough it is.
enum class Material : std::uint8_t {
  road,
  kerb,
  sidewalk,
  wall,
  pole,
  tree,
  car,
  grass,
  gravel,
  hedge,
  glass,
  metal,
  fence,
  person
};
inline constexpr int kMaterialCount = 14;
inline constexpr const char* kMaterialNames[kMaterialCount] = {"road",  "kerb",  "sidewalk", "wall",   "pole",
                                                               "tree",  "car",   "grass",    "gravel", "hedge",
                                                               "glass", "metal", "fence",    "person"};

/// Before and after the scene's one change (Scene::maybe_change_s), which parts of the world are there.
enum class When : std::uint8_t { always, before, after };

/// Waypoint of a line on the ground, rounded with an arc.
struct Waypoint {
  Eigen::Vector2d position_m;
  double radius_m = 0;
};

/// Things along the road repeat from one station to another and stand clear of driveways and other roads.
struct RowSpec {
  Side side = Side::right;
  double from_m = 0;
  std::optional<double> maybe_to_m;  ///< absent: the road's end
  When when = When::always;
};

/// A stretch of the road's edge that differs from the rest of it.
struct EdgeSpec {
  RowSpec row{};
  double height_m = 0;                     ///< of the kerb; 0: none, the road ends in `beyond`
  std::optional<Material> maybe_beyond{};  ///< what lies behind it; absent: as along the rest of the road
};

/// Opening for a crossing car: the kerb is lowered to height_m, with a ramp at both ends.
struct DrivewaySpec {
  Side side = Side::right;
  double at_m = 0, width_m = 4, height_m = 0.025;
};

/// Where a side street comes in: a short road of its own, at right angles.
struct MouthSpec {
  Side side = Side::right;
  double at_m = 0, width_m = 7, length_m = 20;
};

/// The kerb stands into the road (depth above 0), or makes room for a bay (below).
struct BulgeSpec {
  RowSpec row{};
  double depth_m = 1.5;
};

enum class WallKind : std::uint8_t { wall, windows, fence, rail };

/// House fronts, a wall, a fence or a guard rail: beside the road, or an explicit polyline.
struct WallSpec {
  RowSpec row{};
  WallKind kind = WallKind::wall;
  double setback_m = 4.0;  ///< from the kerb, outwards
  double height_m = 3.0;
  double length_m = 0;     ///< of one front; 0: one wall from end to end
  double spacing_m = 3.0;  ///< between fronts
  double depth_m = 0;      ///< of the side walls at each end
  std::vector<Eigen::Vector2d> points_m{};
};

struct HedgeSpec {
  RowSpec row{};
  double setback_m = 3.0, height_m = 1.4, width_m = 0.8;
  double porous_m = 0.4;  ///< deepest place in its leaves that a beam reaches
  std::vector<Eigen::Vector2d> points_m{};
};

/// Lamp posts, trunks, bins.
struct PoleSpec {
  RowSpec row{};
  double setback_m = 0.6;
  double every_m = 20.0;
  double radius_m = 0.08;
  double height_m = 5.0;
  double crown_m = 0;  ///< radius of a tree's crown, from 2.5 m up
  Material material = Material::pole;
  std::vector<Eigen::Vector2d> points_m{};
};

/// Parked cars beside the kerb.
struct ParkedCarSpec {
  RowSpec row{};
  double clearance_m = 0.25;  ///< from the kerb, inwards
  double length_m = 4.4, width_m = 1.8, height_m = 1.5;
  double spacing_m = 1.2;  ///< from bumper to bumper
  double missing = 0;      ///< share of the places that are free
};

struct RoadSpec {
  std::vector<Waypoint> waypoints;
  bool closed = false;
  double width_m = 7.0;
  double crown_percent = 2.0;
  double kerb_height_m = 0.12, kerb_round_m = 0.02;
  double sidewalk_m = 3.0, sidewalk_percent = 2.0;  ///< width; rise outwards
  Material beyond = Material::grass;                ///< behind the sidewalk
  When when = When::always;
  std::vector<EdgeSpec> edges;
  std::vector<DrivewaySpec> driveways;
  std::vector<MouthSpec> mouths;
  std::vector<BulgeSpec> bulges;
  std::vector<WallSpec> walls;
  std::vector<HedgeSpec> hedges;
  std::vector<PoleSpec> poles;
  std::vector<ParkedCarSpec> parked_cars;
};

/// Raised ground within the road's area.
struct IslandSpec {
  std::vector<Eigen::Vector2d> points_m{};
  double kerb_height_m = 0.12;
  Material top = Material::grass;
  When when = When::always;
};

/// A Gaussian rise or hollow of the land.
struct HillSpec {
  Eigen::Vector2d at_m{0, 0};
  double height_m = 0;
  double along_m = 100, across_m = 100;  ///< sigmas
  double heading_deg = 0;                ///< of "along"
};

enum class MoverKind : std::uint8_t { car, cyclist, pedestrian };

/// Goes along its line at constant speed from one time on, until the line's end. A closed line it goes round.
struct MoverSpec {
  MoverKind kind = MoverKind::car;
  std::vector<Waypoint> path;
  bool closed = false;
  double lane_m = 0;  ///< beside the line, left positive
  double from_m = 0, speed_mps = 8, start_s = 0;
};

}  // namespace roadvec
