#include "tools/simulate/truth_files.h"

#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>

#include "tools/recording/car_messages.h"

namespace roadvec {
void write_poses_tum(const Scene& scene, const CarMotion& motion, double duration_s, OutputFile& file) {
  const Pose2 start = motion.at(0).pose;
  for (std::int64_t tick = 0; static_cast<double>(tick) * 0.01 <= duration_s; ++tick) {
    const Pose2 pose = motion.at(static_cast<double>(tick) * 0.01).pose;
    file.write(print("%s %.5f %.5f 0.00000 0.0000000000 0.0000000000 %.10f %.10f\n",
                     stamp({scene.start_ns + tick * 10'000'000}).c_str(), pose.x_m - start.x_m, pose.y_m - start.y_m,
                     std::sin(pose.theta_rad / 2), std::cos(pose.theta_rad / 2)));
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
  std::uint64_t line_count = 0;
  file.write("{\"type\":\"FeatureCollection\",\"features\":[");
  for (const TruthLine& line : built.truth) {
    const auto seen = [&](std::int32_t face) { return faces_seen[static_cast<std::size_t>(face)].within_m(); };
    for (std::int32_t first = line.first; first < line.last;) {
      std::int32_t last = first + 1;
      while (last < line.last && seen(last) == seen(first)) ++last;
      file.write(
          print("%s\n{\"type\":\"Feature\",\"properties\":{\"kind\":\"%s\",\"height_m\":%.3f,\"seen_within_m\":%s},"
                "\"geometry\":{\"type\":\"LineString\",\"coordinates\":[",
                line_count++ == 0 ? "" : ",", std::string(line.kind).c_str(), line.height_m,
                std::isinf(seen(first)) ? "null" : print("%.0f", seen(first)).c_str()));
      file.write(position(built.world.faces()[static_cast<std::size_t>(first)].a_m));
      for (std::int32_t face = first; face < last; ++face) {
        file.write("," + position(built.world.faces()[static_cast<std::size_t>(face)].b_m));
      }
      file.write("]}}");
      first = last;
    }
  }
  file.write("\n]}\n");
  return line_count;
}

}  // namespace roadvec
