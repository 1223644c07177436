#include "tools/simulate/scene_file.h"

#include <cmath>
#include <fstream>
#include <sstream>

#include "tools/simulate/scene_world_file.h"
#include "tools/simulate/toml_table.h"

namespace roadvec {
namespace {

void read_car(TomlTable& table, CarSpec& car) {
  table.number("wheelbase_m", car.wheelbase_m, 1, 8);
  table.number("track_m", car.track_m, 0.8, 3);
  table.number("steering_ratio", car.steering_ratio, 1, 40);
  car.route = read_waypoints(table, "route");
  table.flag("route_closed", car.route_closed);
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

Scene read_scene(TomlTable& top) {
  Scene scene;
  double start_unix_s = 1767268800;  // 2026-01-01 12:00:00 UTC
  top.text("description", scene.description);
  top.number("start_unix_s", start_unix_s, 0, 4e9);
  scene.start_ns = std::llround(start_unix_s * 1e6) * 1000;
  read_world(top, scene);
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

Expected<std::string> load_scene_text(const std::string& name_or_path) {
  for (const ShippedScene& scene : shipped_scenes()) {
    if (scene.name == name_or_path) return std::string(scene.text);
  }
  std::ifstream file(name_or_path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    return fail("no shipped scene and no readable file is called '" + name_or_path + "'; --list names the scenes");
  }
  return text.str();
}

Expected<Scene> load_scene(const std::string& name_or_path) {
  return load_scene_text(name_or_path).and_then([&](const std::string& text) {
    return parse_scene(text, name_or_path);
  });
}

}  // namespace roadvec
