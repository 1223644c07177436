#include "tools/import/report_text.h"

#include <nlohmann/json.hpp>

#include "tools/recording/output_file.h"

namespace roadvec {

std::string text_of(const ImportReport& report, const std::string& out) {
  const auto n = [](std::uint64_t count) { return static_cast<unsigned long long>(count); };
  std::string text = print("%s: %zu sweeps, %.1f s, %.1f m driven; %llu packets, %llu CAN frames, %llu IMU samples\n",
                           out.c_str(), report.frame_count, report.duration_s, report.distance_m,
                           n(report.packet_count), n(report.can_frame_count), n(report.imu_sample_count));
  text += print(
      "packets decode to the scans' points within %.2f mm (median), %.2f mm (95 %%), %.2f mm (largest); %llu "
      "points, %llu have no echo of their own, %llu are missing\n",
      1e3 * report.round_trip.median_m, 1e3 * report.round_trip.quantile95_m, 1e3 * report.round_trip.max_m,
      n(report.point_count), n(report.lost_point_count), n(report.round_trip.missing_count));
  text += print(
      "head: 95 %% of the points within %.2f mm of their laser's cone and %.3f of an encoder cell; lasers "
      "agree on %.1f %% of the firings or more\n",
      1e3 * report.off_the_line_m, report.cell_error, 100 * report.rotation_agreement);
  text +=
      print("truth: %.0f %% of the points lie on surfaces that other sweeps have seen, %.1f mm from them (median)\n",
            100 * report.matched_share, 1e3 * report.residual_m);
  for (const LeftOut& run : report.left_out) {
    text += "left out: " + run.first;
    if (run.count > 1) text += print(" to %s (%zu)", run.last.c_str(), run.count);
    text += ": " + run.reason + "\n";
  }
  return text;
}

std::string json_of(const ImportReport& report, const std::string& out) {
  nlohmann::ordered_json left_out = nlohmann::ordered_json::array();
  for (const LeftOut& run : report.left_out) {
    left_out.push_back({{"first", run.first}, {"last", run.last}, {"count", run.count}, {"reason", run.reason}});
  }
  const nlohmann::ordered_json json{
      {"out", out},
      {"sweeps", report.frame_count},
      {"duration_s", report.duration_s},
      {"distance_m", report.distance_m},
      {"packets", report.packet_count},
      {"lidar_bytes", report.lidar_bytes},
      {"can_frames", report.can_frame_count},
      {"imu_samples", report.imu_sample_count},
      {"round_trip",
       {{"points", report.point_count},
        {"without_echo", report.lost_point_count},
        {"missing", report.round_trip.missing_count},
        {"median_m", report.round_trip.median_m},
        {"quantile95_m", report.round_trip.quantile95_m},
        {"max_m", report.round_trip.max_m},
        {"faithful", report.faithful()}}},
      {"head",
       {{"off_the_cone_m", report.off_the_line_m},
        {"off_the_cone_points", report.off_point_count},
        {"cell_error", report.cell_error},
        {"rotation_agreement", report.rotation_agreement}}},
      {"truth", {{"residual_m", report.residual_m}, {"matched_share", report.matched_share}}},
      {"left_out", left_out}};
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace roadvec
