#include "tools/simulate/truth_files.h"

#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

/// "t x y z qx qy qz qw": the rear axle in the map frame, which begins where the car does.
void write_pose(const Scene& scene, const CarMotion& motion, std::int64_t after_start_ns, OutputFile& file) {
  const CarState start = motion.at(0);
  const Eigen::Isometry3d T = motion.at(static_cast<double>(after_start_ns) * 1e-9).T_scene_vehicle();
  const Eigen::Vector3d p_m = T.translation() - Eigen::Vector3d(start.pose.x_m, start.pose.y_m, start.z_m);
  const Eigen::Quaterniond q(T.rotation());
  const std::int64_t ns = scene.start_ns + after_start_ns;
  file.write(print("%lld.%09lld %.5f %.5f %.5f %.10f %.10f %.10f %.10f\n", static_cast<long long>(ns / 1'000'000'000),
                   static_cast<long long>(ns % 1'000'000'000), p_m.x(), p_m.y(), p_m.z(), q.x(), q.y(), q.z(), q.w()));
}

}  // namespace

void write_poses_tum(const Scene& scene, const CarMotion& motion, double duration_s, OutputFile& file) {
  for (std::int64_t tick = 0; static_cast<double>(tick) * 0.01 <= duration_s; ++tick) {
    write_pose(scene, motion, tick * 10'000'000, file);
  }
}

void write_sweeps_tum(const Scene& scene, const CarMotion& motion, double duration_s, OutputFile& file) {
  for (std::int64_t sweep = 1; static_cast<double>(sweep) / scene.lidar.rotation_hz <= duration_s; ++sweep) {
    write_pose(scene, motion, std::llround(static_cast<double>(sweep) * 1e9 / scene.lidar.rotation_hz), file);
  }
}

std::uint64_t write_boundaries_geojson(const Scene& scene, const BuiltWorld& built, const Pose2& start,
                                       std::span<const SeenFrom> faces_seen, OutputFile& file) {
  const GeographicLib::LocalCartesian map(scene.anchor.latitude_deg, scene.anchor.longitude_deg, scene.anchor.height_m);
  const auto position = [&](const Eigen::Vector2d& point_m) {
    double latitude_deg = 0, longitude_deg = 0, height_m = 0;
    map.Reverse(point_m.x() - start.x_m, point_m.y() - start.y_m, 0, latitude_deg, longitude_deg, height_m);
    return print("[%.9f,%.9f]", longitude_deg, latitude_deg);
  };
  const auto seen_within_m = [&](const TruthPiece& piece) {
    const auto of = [&](std::size_t face) { return faces_seen[face].within_m(); };
    const double within_m = of(static_cast<std::size_t>(&piece - built.truth.data()));
    return piece.earlier < 0 ? within_m : std::min(within_m, of(static_cast<std::size_t>(piece.earlier)));
  };
  const auto is_written = [&](const TruthPiece& piece) {
    return !scene.maybe_change_s || piece.phase == 1 || piece.gone;
  };
  const auto properties = [&](const TruthPiece& piece) {
    const double within_m = seen_within_m(piece);
    std::string text = print("\"kind\":\"%s\",\"height_m\":%.2f,\"seen_within_m\":%s", std::string(piece.kind).c_str(),
                             piece.height_m, std::isinf(within_m) ? "null" : print("%.0f", within_m).c_str());
    if (piece.gone) text += print(",\"removed\":true,\"until_s\":%.3f", *scene.maybe_change_s);
    if (piece.phase == 1 && piece.earlier < 0) text += print(",\"from_s\":%.3f", *scene.maybe_change_s);
    return text;
  };
  std::uint64_t line_count = 0;
  std::string line_properties;
  file.write("{\"type\":\"FeatureCollection\",\"features\":[");
  for (const TruthPiece& piece : built.truth) {
    if (!is_written(piece)) {
      line_properties.clear();
      continue;
    }
    const std::string own = properties(piece);
    if (!piece.continues || own != line_properties) {
      file.write(line_count == 0 ? "" : "]}}");
      file.write(
          print("%s\n{\"type\":\"Feature\",\"properties\":{%s},\"geometry\":{\"type\":\"LineString\",\"coordinates\":[",
                line_count++ == 0 ? "" : ",", own.c_str()) +
          position(piece.a_m));
      line_properties = own;
    }
    file.write("," + position(piece.b_m));
  }
  file.write(line_count == 0 ? "]}\n" : "]}}\n]}\n");
  return line_count;
}

}  // namespace roadvec
