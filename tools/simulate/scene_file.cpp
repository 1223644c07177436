#include "tools/simulate/scene_file.h"

#include <cmath>
#include <fstream>
#include <sstream>

#include "tools/simulate/toml_table.h"

namespace roadvec {
namespace {

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

void read_row(TomlTable& table, RowSpec& row) {
  read_side(table, row.side);
  table.number("from_m", row.from_m, 0, 1e5);
  if (!table.has("to_m")) return;
  double to_m = row.from_m;
  table.number("to_m", to_m, row.from_m, 1e5);
  row.maybe_to_m = to_m;
}

void read_road(TomlTable& table, RoadSpec& road) {
  std::vector<std::vector<double>> rows;
  table.require("waypoints");
  table.rows("waypoints", rows, 2, 3);
  for (const auto& row : rows) road.waypoints.push_back({{row[0], row[1]}, row.size() > 2 ? row[2] : 0.0});
  table.flag("closed", road.closed);
  table.number("width_m", road.width_m, 3, 40);
  table.number("kerb_height_m", road.kerb_height_m, 0.02, 0.5);
  table.number("sidewalk_m", road.sidewalk_m, 0.5, 60);
  table.tables("gap", [&](TomlTable& entry) {
    KerbGap gap;
    read_side(entry, gap.side);
    entry.require("at_m");
    entry.number("at_m", gap.at_m, 0, 1e5);
    entry.number("width_m", gap.width_m, 0.5, 50);
    entry.number("radius_m", gap.radius_m, 0, road.sidewalk_m);
    road.gaps.push_back(gap);
  });
}

void read_wall(TomlTable& table, WallSpec& wall) {
  read_row(table, wall.row);
  table.number("setback_m", wall.setback_m, 0, 60);
  table.number("height_m", wall.height_m, 0.1, 50);
  table.number("length_m", wall.length_m, 0, 1000);
  table.number("spacing_m", wall.spacing_m, 0.1, 1000);
  table.number("depth_m", wall.depth_m, 0, 60);
  wall.points_m = read_points(table, "points_m");
}

void read_pole(TomlTable& table, PoleSpec& pole) {
  read_row(table, pole.row);
  table.number("setback_m", pole.setback_m, 0, 60);
  table.number("every_m", pole.every_m, 0.5, 1000);
  table.number("radius_m", pole.radius_m, 0.02, 2);
  table.number("height_m", pole.height_m, 0.1, 30);
  int word = pole.material == Material::tree ? 1 : 0;
  table.word("material", word, {"pole", "tree"});
  pole.material = word == 1 ? Material::tree : Material::pole;
  pole.points_m = read_points(table, "points_m");
}

void read_parked_cars(TomlTable& table, ParkedCarSpec& cars) {
  read_row(table, cars.row);
  table.number("clearance_m", cars.clearance_m, 0, 10);
  table.number("length_m", cars.length_m, 0.5, 30);
  table.number("width_m", cars.width_m, 0.3, 5);
  table.number("height_m", cars.height_m, 0.3, 5);
  table.number("spacing_m", cars.spacing_m, 0.1, 1000);
}

void read_car(TomlTable& table, CarSpec& car) {
  table.number("wheelbase_m", car.wheelbase_m, 1, 8);
  table.number("track_m", car.track_m, 0.8, 3);
  table.number("steering_ratio", car.steering_ratio, 1, 40);
  table.number("lane_m", car.lane_m, -20, 20);
  table.number("start_m", car.start_m, 0, 1e5);
  table.number("distance_m", car.distance_m, 0, 1e5);
  table.number("wait_s", car.wait_s, 0, 600);
  table.number("speed_mps", car.speed_mps, 0.5, 30);
  table.number("acceleration_mps2", car.acceleration_mps2, 0.2, 5);
  table.number("side_acceleration_mps2", car.side_acceleration_mps2, 0.2, 6);
  table.number("jerk_mps3", car.jerk_mps3, 0.5, 50);
  table.number("understeer_rad_per_mps2", car.understeer_rad_per_mps2, -0.005, 0.02);
  table.number("rear_slip_rad_per_mps2", car.rear_slip_rad_per_mps2, 0, 0.03);
  table.number("pitch_deg_per_mps2", car.pitch_deg_per_mps2, 0, 1);
  table.number("roll_deg_per_mps2", car.roll_deg_per_mps2, 0, 2);
}

void read_lidar(TomlTable& table, LidarSpec& lidar) {
  table.text("model", lidar.model);
  table.number("x_m", lidar.x_m, -5, 10);
  table.number("y_m", lidar.y_m, -3, 3);
  table.number("z_m", lidar.z_m, 0.3, 5);
  table.number("roll_deg", lidar.roll_deg, -30, 30);
  table.number("pitch_deg", lidar.pitch_deg, -30, 30);
  table.number("yaw_deg", lidar.yaw_deg, -180, 180);
  table.number("rotation_hz", lidar.rotation_hz, 5, 20);
  table.number("range_m", lidar.range_m, 5, 300);
  int word = static_cast<int>(lidar.return_mode);
  table.word("return_mode", word, {"strongest", "last", "dual"});
  lidar.return_mode = static_cast<ReturnMode>(word);
  table.number("wet", lidar.wet, 0, 1);
}

void read_errors(TomlTable& table, ErrorSpec& errors) {
  table.number("steering_offset_deg", errors.steering_offset_deg, -45, 45);
  table.number("wheel_speed_scale", errors.wheel_speed_scale, 0.8, 1.2);
  table.number("wheel_radius_spread", errors.wheel_radius_spread, 0, 0.05);
  table.number("can_latency_ms", errors.can_latency_ms, 0, 500);
  table.number("can_jitter_ms", errors.can_jitter_ms, 0, 100);
  table.number("steering_step_deg", errors.steering_step_deg, 0.001, 10);
  table.number("wheel_speed_step_kmph", errors.wheel_speed_step_kmph, 0.001, 10);
  table.number("gyro_bias_degps", errors.gyro_bias_degps, -10, 10);
  table.number("gyro_noise_radps", errors.gyro_noise_radps, 0, 1);
  table.number("acceleration_noise_mps2", errors.acceleration_noise_mps2, 0, 10);
  table.number("compass_wander_deg", errors.compass_wander_deg, 0, 90);
  table.number("compass_wander_s", errors.compass_wander_s, 0.1, 1e5);
  table.number("compass_soft_iron_deg", errors.compass_soft_iron_deg, 0, 45);
  table.number("range_noise_m", errors.range_noise_m, 0, 1);
  table.number("laser_bias_m", errors.laser_bias_m, 0, 1);
  table.number("laser_elevation_deg", errors.laser_elevation_deg, 0, 1);
  table.number("packet_loss", errors.packet_loss, 0, 0.99);
  table.number("packet_reordering", errors.packet_reordering, 0, 0.5);
  table.number("arrival_jitter_us", errors.arrival_jitter_us, 0, 1e5);
}

void read_reflectivity(TomlTable& table, double (&reflectivity)[kMaterialCount]) {
  const char* const names[kMaterialCount] = {"road", "kerb", "sidewalk", "wall", "pole", "tree", "car"};
  for (int i = 0; i < kMaterialCount; ++i) table.number(names[i], reflectivity[i], 0.01, 1);
}

Scene read_scene(TomlTable& top) {
  Scene scene;
  double start_unix_s = 1767268800;  // 2026-01-01 12:00:00 UTC
  top.text("description", scene.description);
  top.number("start_unix_s", start_unix_s, 0, 4e9);
  scene.start_ns = std::llround(start_unix_s * 1e6) * 1000;
  top.require("road");
  top.table("road", [&](TomlTable& table) { read_road(table, scene.road); });
  top.tables("wall", [&](TomlTable& table) { read_wall(table, scene.walls.emplace_back()); });
  top.tables("pole", [&](TomlTable& table) { read_pole(table, scene.poles.emplace_back()); });
  top.tables("parked_cars", [&](TomlTable& table) { read_parked_cars(table, scene.parked_cars.emplace_back()); });
  top.table("reflectivity", [&](TomlTable& table) { read_reflectivity(table, scene.reflectivity); });
  top.table("car", [&](TomlTable& table) { read_car(table, scene.car); });
  top.table("lidar", [&](TomlTable& table) { read_lidar(table, scene.lidar); });
  top.table("errors", [&](TomlTable& table) { read_errors(table, scene.errors); });
  top.table("anchor", [&](TomlTable& table) {
    table.number("latitude_deg", scene.anchor.latitude_deg, -85, 85);
    table.number("longitude_deg", scene.anchor.longitude_deg, -180, 180);
    table.number("height_m", scene.anchor.height_m, -500, 9000);
  });
  top.refuse_unknown_keys();
  return scene;
}

}  // namespace

Expected<Scene> parse_scene(std::string_view text, const std::string& file) {
  try {
    const toml::table table = toml::parse(text, file);
    TomlProblem problem{file, {}};
    TomlTable top(table, "", problem);
    Scene scene = read_scene(top);
    if (!problem.message.empty()) return fail(problem.message);
    return scene;
  } catch (const toml::parse_error& error) {
    return fail(file + ":" + std::to_string(error.source().begin.line) + ": " + std::string(error.description()));
  }
}

Expected<Scene> load_scene(const std::string& name_or_path) {
  for (const ShippedScene& scene : shipped_scenes()) {
    if (scene.name == name_or_path) return parse_scene(scene.text, name_or_path + ".toml");
  }
  std::ifstream file(name_or_path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    return fail("no shipped scene and no readable file is called '" + name_or_path + "'; --list names the scenes");
  }
  return parse_scene(text.str(), name_or_path);
}

}  // namespace roadvec
