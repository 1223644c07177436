#include "daemon/results.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "daemon/server/map_files.h"

namespace roadvec {
namespace {

/// Under another name first: a crash or a full disk never leaves half a file under the good name.
Expected<void> write_file(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::path part = path;
  part += ".part";
  std::ofstream file(part, std::ios::binary);
  file << text;
  file.close();
  std::error_code error;
  if (file.good()) std::filesystem::rename(part, path, error);
  if (!file.good() || error) {
    std::filesystem::remove(part, error);
    return fail(fmt::format("cannot write {}: is the directory writable and the disk not full?", path.string()));
  }
  return {};
}

std::string trajectory_text(const BackEnd& back_end) {
  std::string text;
  for (const TrajectoryPoint& point : back_end.trajectory()) {
    const Pose2& pose = point.T_map_vehicle;
    text += fmt::format("{}.{:09d} {:.4f} {:.4f} 0.0000 0.0000000 0.0000000 {:.7f} {:.7f}\n",
                        point.time.ns / 1'000'000'000, point.time.ns % 1'000'000'000, pose.x_m, pose.y_m,
                        std::sin(0.5 * pose.theta_rad), std::cos(0.5 * pose.theta_rad));
  }
  return text;
}

std::string picture(const BackEnd& back_end, const wire::Status& status) {
  std::vector<Eigen::Vector2d> path;
  for (const TrajectoryPoint& point : back_end.trajectory()) path.push_back(point.T_map_vehicle.translation());
  const std::string title =
      fmt::format("{:.0f} m of boundary, {:.0f} m driven", status.map_length_m, status.travelled_m);
  return svg_of(back_end.map(), path, title);
}

nlohmann::ordered_json json_of(const wire::Stage& stage) {
  nlohmann::ordered_json json;
  json["state"] = stage.state;
  if (!stage.detail.empty()) json["detail"] = stage.detail;
  for (const wire::Counter& counter : stage.counters) json["counters"][counter.name] = counter.value;
  for (const wire::Gauge& gauge : stage.gauges) json["gauges"][gauge.name] = gauge.value;
  for (const wire::Timing& timing : stage.timings) {
    json["steps"][timing.step] = {
        {"count", timing.count}, {"p50_us", timing.p50_us}, {"p99_us", timing.p99_us}, {"max_us", timing.max_us}};
  }
  return json;
}

std::string report_text(const BackEnd& back_end, const wire::Status& status) {
  nlohmann::ordered_json json;
  json["version"] = status.server_version;
  json["wall_time_s"] = status.uptime_s;
  json["travelled_m"] = status.travelled_m;
  json["keyframes"] = status.keyframe_count;
  json["loops"] = status.loop_closure_count;
  json["map_length_m"] = status.map_length_m;
  json["map_lines"] = status.line_count;
  json["map_tile_bytes"] = tile_bytes(back_end.map());
  for (const wire::Stage& stage : status.stages) json["stages"][stage.name] = json_of(stage);
  return json.dump(2) + "\n";
}

}  // namespace

Anchor anchor_of(const Settings& settings) {
  const AnchorSettings& anchor = settings.anchor.value();
  return {anchor.latitude_deg, anchor.longitude_deg, anchor.height_m, anchor.yaw_deg};
}

Expected<void> make_writable(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) return fail(fmt::format("cannot make the directory {}: {}", directory.string(), error.message()));
  if (::access(directory.c_str(), W_OK | X_OK) == 0) return {};
  return fail(fmt::format("cannot write into the directory {}: {}", directory.string(), std::strerror(errno)));
}

Expected<void> write_all(const Results& results, const std::filesystem::path& directory) {
  if (const Expected<void> ready = make_writable(directory); !ready) return ready;
  for (const auto& [name, text] : {std::pair{"map.geojson", geojson_of(results.back_end.map(), results.anchor)},
                                   std::pair{"map.svg", picture(results.back_end, results.status)},
                                   std::pair{"trajectory.tum", trajectory_text(results.back_end)},
                                   std::pair{"report.json", report_text(results.back_end, results.status)}}) {
    if (const Expected<void> written = write_file(directory / name, text); !written) return written;
  }
  return {};
}

}  // namespace roadvec
