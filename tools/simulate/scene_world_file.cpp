#include "tools/simulate/scene_world_file.h"

namespace roadvec {
namespace {

constexpr double kFarthest_m = 1e5, kLatest_s = 1e5;

std::vector<Eigen::Vector2d> read_points(TomlTable& table, std::string_view key) {
  std::vector<std::vector<double>> rows;
  table.rows(key, rows, 2, 2);
  std::vector<Eigen::Vector2d> points_m;
  for (const auto& row : rows) points_m.emplace_back(row[0], row[1]);
  return points_m;
}

void read_side(TomlTable& table, Side& side) {
  int word = static_cast<int>(side);
  table.word("side", word, {"left", "right"});
  side = static_cast<Side>(word);
}

void read_when(TomlTable& table, When& when) {
  int word = static_cast<int>(when);
  table.word("when", word, {"always", "before", "after"});
  when = static_cast<When>(word);
}

/// One of the materials named.
void read_material(TomlTable& table, std::string_view key, Material& material,
                   std::initializer_list<Material> materials) {
  std::vector<std::string_view> names;
  for (const Material one : materials) names.emplace_back(kMaterialNames[static_cast<int>(one)]);
  int word = -1;
  table.word(key, word, names);
  if (word >= 0) material = materials.begin()[word];
}

void read_row(TomlTable& table, RowSpec& row) {
  read_side(table, row.side);
  read_when(table, row.when);
  table.number("from_m", row.from_m, 0, kFarthest_m);
  if (!table.has("to_m")) return;
  double to_m = row.from_m;
  table.number("to_m", to_m, row.from_m, kFarthest_m);
  row.maybe_to_m = to_m;
}

void read_kerb(TomlTable& table, RoadSpec& road) {
  EdgeSpec edge{.height_m = road.kerb_height_m};
  read_row(table, edge.row);
  table.number("height_m", edge.height_m, 0.02, 0.5);
  road.edges.push_back(edge);
}

void read_verge(TomlTable& table, RoadSpec& road) {
  Material material = Material::grass;
  EdgeSpec edge;
  read_row(table, edge.row);
  read_material(table, "material", material, {Material::grass, Material::gravel});
  edge.maybe_beyond = material;
  road.edges.push_back(edge);
}

void read_driveway(TomlTable& table, RoadSpec& road) {
  DrivewaySpec driveway;
  read_side(table, driveway.side);
  table.require("at_m");
  table.number("at_m", driveway.at_m, 0, kFarthest_m);
  table.number("width_m", driveway.width_m, 0.5, 50);
  table.number("height_m", driveway.height_m, 0, 0.5);
  road.driveways.push_back(driveway);
}

void read_mouth(TomlTable& table, RoadSpec& road) {
  MouthSpec mouth;
  read_side(table, mouth.side);
  table.require("at_m");
  table.number("at_m", mouth.at_m, 0, kFarthest_m);
  table.number("width_m", mouth.width_m, 2, 40);
  table.number("length_m", mouth.length_m, 1, 200);
  road.mouths.push_back(mouth);
}

void read_bulge(TomlTable& table, RoadSpec& road) {
  BulgeSpec bulge;
  read_row(table, bulge.row);
  table.require("to_m");
  table.number("depth_m", bulge.depth_m, -10, 10);
  road.bulges.push_back(bulge);
}

/// A wall, or with other defaults a fence or a guard rail.
void read_wall(TomlTable& table, RoadSpec& road, WallSpec wall) {
  read_row(table, wall.row);
  table.number("setback_m", wall.setback_m, 0, 60);
  table.number("height_m", wall.height_m, 0.1, 50);
  if (wall.kind == WallKind::wall) {
    bool windows = false;
    table.flag("windows", windows);
    if (windows) wall.kind = WallKind::windows;
    table.number("length_m", wall.length_m, 0, 1000);
    table.number("spacing_m", wall.spacing_m, 0.1, 1000);
    table.number("depth_m", wall.depth_m, 0, 60);
  }
  wall.points_m = read_points(table, "points_m");
  road.walls.push_back(std::move(wall));
}

void read_hedge(TomlTable& table, RoadSpec& road) {
  HedgeSpec hedge;
  read_row(table, hedge.row);
  table.number("setback_m", hedge.setback_m, 0, 60);
  table.number("height_m", hedge.height_m, 0.1, 10);
  table.number("width_m", hedge.width_m, 0.1, 5);
  table.number("porous_m", hedge.porous_m, 0, 2);
  hedge.points_m = read_points(table, "points_m");
  road.hedges.push_back(std::move(hedge));
}

void read_pole(TomlTable& table, RoadSpec& road, PoleSpec pole) {
  read_row(table, pole.row);
  table.number("setback_m", pole.setback_m, 0, 60);
  table.number("every_m", pole.every_m, 0.5, 1000);
  table.number("radius_m", pole.radius_m, 0.02, 2);
  table.number("height_m", pole.height_m, 0.1, 30);
  read_material(table, "material", pole.material, {Material::pole, Material::tree, Material::metal});
  table.number("crown_m", pole.crown_m, 0, 6);
  pole.points_m = read_points(table, "points_m");
  road.poles.push_back(std::move(pole));
}

void read_parked_cars(TomlTable& table, RoadSpec& road) {
  ParkedCarSpec cars;
  read_row(table, cars.row);
  table.number("clearance_m", cars.clearance_m, -3, 10);
  table.number("length_m", cars.length_m, 2, 30);
  table.number("width_m", cars.width_m, 1, 5);
  table.number("height_m", cars.height_m, 1, 5);
  table.number("spacing_m", cars.spacing_m, 0.1, 1000);
  table.number("missing", cars.missing, 0, 1);
  road.parked_cars.push_back(cars);
}

void read_along(TomlTable& table, RoadSpec& road) {
  table.tables("kerb", [&](TomlTable& row) { read_kerb(row, road); });
  table.tables("verge", [&](TomlTable& row) { read_verge(row, road); });
  table.tables("driveway", [&](TomlTable& row) { read_driveway(row, road); });
  table.tables("mouth", [&](TomlTable& row) { read_mouth(row, road); });
  table.tables("bulge", [&](TomlTable& row) { read_bulge(row, road); });
  table.tables("wall", [&](TomlTable& row) { read_wall(row, road, {}); });
  table.tables("fence", [&](TomlTable& row) { read_wall(row, road, {.kind = WallKind::fence, .height_m = 1.2}); });
  table.tables("guard_rail", [&](TomlTable& row) {
    read_wall(row, road, {.kind = WallKind::rail, .setback_m = 0.5, .height_m = 0.75});
  });
  table.tables("hedge", [&](TomlTable& row) { read_hedge(row, road); });
  table.tables("pole", [&](TomlTable& row) { read_pole(row, road, {}); });
  table.tables("bin", [&](TomlTable& row) {
    read_pole(row, road, {.every_m = 25, .radius_m = 0.29, .height_m = 1.07, .material = Material::metal});
  });
  table.tables("parked_cars", [&](TomlTable& row) { read_parked_cars(row, road); });
}

void read_road(TomlTable& table, RoadSpec& road) {
  table.require("waypoints");
  road.waypoints = read_waypoints(table, "waypoints");
  table.flag("closed", road.closed);
  table.number("width_m", road.width_m, 2, 40);
  table.number("crown_percent", road.crown_percent, -5, 5);
  table.number("kerb_height_m", road.kerb_height_m, 0.02, 0.5);
  table.number("kerb_round_m", road.kerb_round_m, 0, 0.05);
  table.number("sidewalk_m", road.sidewalk_m, 0, 60);
  table.number("sidewalk_percent", road.sidewalk_percent, -10, 10);
  read_material(table, "beyond", road.beyond, {Material::grass, Material::gravel, Material::sidewalk});
  read_when(table, road.when);
  read_along(table, road);
}

void read_island(TomlTable& table, IslandSpec& island) {
  table.require("points_m");
  island.points_m = read_points(table, "points_m");
  if (!island.points_m.empty() && island.points_m.size() < 3) table.complain("points_m", "needs three corners");
  table.number("kerb_height_m", island.kerb_height_m, 0.02, 0.5);
  read_material(table, "top", island.top, {Material::grass, Material::gravel, Material::sidewalk});
  read_when(table, island.when);
}

void read_hill(TomlTable& table, HillSpec& hill) {
  table.require("at_m");
  const auto places = read_points(table, "at_m");
  if (places.size() == 1) hill.at_m = places.front();
  if (places.size() > 1) table.complain("at_m", "must be one place, [[x, y]]");
  table.number("height_m", hill.height_m, -100, 100);
  table.number("along_m", hill.along_m, 5, kFarthest_m);
  table.number("across_m", hill.across_m, 5, kFarthest_m);
  table.number("heading_deg", hill.heading_deg, -360, 360);
}

void read_mover(TomlTable& table, MoverSpec& mover) {
  int word = 0;
  table.word("kind", word, {"car", "cyclist", "pedestrian"});
  mover.kind = static_cast<MoverKind>(word);
  table.require("waypoints");
  mover.path = read_waypoints(table, "waypoints");
  table.flag("closed", mover.closed);
  table.number("lane_m", mover.lane_m, -20, 20);
  table.number("from_m", mover.from_m, 0, kFarthest_m);
  table.number("speed_mps", mover.speed_mps, 0.1, 40);
  table.number("start_s", mover.start_s, 0, kLatest_s);
}

void read_by_material(TomlTable& table, double (&values)[kMaterialCount], double least, double most) {
  for (int i = 0; i < kMaterialCount; ++i) table.number(kMaterialNames[i], values[i], least, most);
}

}  // namespace

std::vector<Waypoint> read_waypoints(TomlTable& table, std::string_view key) {
  std::vector<std::vector<double>> rows;
  table.rows(key, rows, 2, 3);
  std::vector<Waypoint> waypoints;
  for (const auto& row : rows) waypoints.push_back({{row[0], row[1]}, row.size() > 2 ? row[2] : 0.0});
  return waypoints;
}

void read_world(TomlTable& top, Scene& scene) {
  top.require("road");
  top.tables("road", [&](TomlTable& table) { read_road(table, scene.roads.emplace_back()); });
  top.tables("island", [&](TomlTable& table) { read_island(table, scene.islands.emplace_back()); });
  top.tables("hill", [&](TomlTable& table) { read_hill(table, scene.hills.emplace_back()); });
  top.tables("mover", [&](TomlTable& table) { read_mover(table, scene.movers.emplace_back()); });
  top.table("land", [&](TomlTable& table) {
    table.number("slope_percent", scene.slope_percent, -20, 20);
    table.number("slope_heading_deg", scene.slope_heading_deg, -360, 360);
  });
  top.number("corner_radius_m", scene.corner_radius_m, 0, 30);
  if (top.has("change_s")) top.number("change_s", scene.maybe_change_s.emplace(0), 0, kLatest_s);
  top.table("reflectivity", [&](TomlTable& table) { read_by_material(table, scene.reflectivity, 0.01, 1); });
  top.table("roughness_m", [&](TomlTable& table) { read_by_material(table, scene.roughness_m, 0, 0.1); });
}

}  // namespace roadvec
