#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>

#include "tools/inspect/lidar_statistics.h"

namespace roadvec {
namespace {

__attribute__((format(printf, 1, 2))) std::string print(const char* format, ...) {
  std::array<char, 200> text{};
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(text.data(), text.size(), format, values);
  va_end(values);
  return text.data();
}

std::string three(const std::array<double, 3>& q) { return print("%.1f / %.1f / %.1f", q[0], q[1], q[2]); }
std::string five(const std::array<int, 5>& q) { return print("%d / %d / %d / %d / %d", q[0], q[1], q[2], q[3], q[4]); }
std::string percent(double share) { return print("%.1f %%", 100 * share); }
std::string millimetres(double m) { return print("%.1f mm", 1000 * m); }

std::string range_label(std::size_t i) {
  if (i + 1 == kRangeBins_m.size()) return print("returns beyond %.0f m", kRangeBins_m[i]);
  return print("returns at %.0f to %.0f m", kRangeBins_m[i], kRangeBins_m[i + 1]);
}

}  // namespace

std::string statistics_markdown(const std::vector<LidarStatistics>& recordings) {
  std::string text = "|";
  const auto row = [&](const std::string& what, auto&& cell) {
    text += "\n| " + what + " |";
    for (const LidarStatistics& s : recordings) text += " " + cell(s) + " |";
  };
  using S = const LidarStatistics&;
  for (std::size_t i = 0; i <= recordings.size(); ++i) text += i == 0 ? " |" : " " + recordings[i - 1].path + " |";
  text += "\n|" + std::string("---|");
  for (std::size_t i = 0; i < recordings.size(); ++i) text += "---|";
  row("model", [](S s) { return s.model; });
  row("revolutions", [](S s) { return print("%.1f", s.revolution_count); });
  row("sweeps, distinct ones", [](S s) { return print("%zu, %zu", s.sweep_count, s.distinct_sweep_count); });
  row("revolutions per second", [](S s) { return print("%.2f", s.revolutions_per_s); });
  row("packets per revolution", [](S s) { return print("%.1f", s.packets_per_revolution); });
  row("packet to packet, device stamps, us (5 / 50 / 95 %)", [](S s) { return three(s.device_step_us); });
  row("packet to packet, arrival, us (5 / 50 / 95 %)", [](S s) { return three(s.arrival_step_us); });
  row("points per revolution", [](S s) { return print("%.0f", s.points_per_revolution); });
  row("firings without a return", [](S s) { return percent(s.missing_share); });
  row("firings with a second return", [](S s) { return percent(s.second_return_share); });
  for (std::size_t i = 0; i < kRangeBins_m.size(); ++i)
    row(range_label(i), [i](S s) { return percent(s.range_share[i]); });
  row("jumps of 0.5 to 2 m in range with a return in mid-air", [](S s) { return percent(s.mixed_share); });
  row("range noise on the road ahead, median laser", [](S s) { return millimetres(s.road_noise_m); });
  row("lasers' heights off the road's surface, rms", [](S s) { return millimetres(s.road_offset_m); });
  row("intensity (5 / 25 / 50 / 75 / 95 %)", [](S s) { return five(s.intensity); });
  row("intensity of the road ahead (5 / 25 / 50 / 75 / 95 %)", [](S s) { return five(s.road_intensity); });
  row("intensity of the road ahead, spread over the lasers",
      [](S s) { return print("%.1f", s.road_intensity_spread); });

  text +=
      "\n\nEach laser, from the highest: elevation, points per revolution, firings without a return, range noise on "
      "the road.\n\n| laser |";
  for (const LidarStatistics& s : recordings) text += " " + s.path + " | | | |";
  text += "\n|---|";
  for (std::size_t i = 0; i < recordings.size(); ++i) text += "---|---|---|---|";
  std::size_t most = 0;
  for (const LidarStatistics& s : recordings) most = std::max(most, s.lasers.size());
  for (std::size_t i = 0; i < most; ++i) {
    row(std::to_string(i), [i](S s) {
      if (i >= s.lasers.size()) return std::string("| | |");
      const LaserStatistics& laser = s.lasers[i];
      return print("%.2f | %.0f | %.1f %% | ", laser.elevation_deg, laser.points_per_revolution,
                   100 * laser.missing_share) +
             (laser.road_window_count > 0 ? millimetres(laser.road_noise_m) : "-");
    });
  }
  return text + "\n";
}

nlohmann::ordered_json json_of(const LidarStatistics& s) {
  nlohmann::ordered_json json{{"path", s.path},
                              {"model", s.model},
                              {"revolutions", s.revolution_count},
                              {"sweeps", s.sweep_count},
                              {"distinct_sweeps", s.distinct_sweep_count},
                              {"revolutions_per_s", s.revolutions_per_s},
                              {"packets_per_revolution", s.packets_per_revolution},
                              {"device_step_us", s.device_step_us},
                              {"arrival_step_us", s.arrival_step_us},
                              {"points_per_revolution", s.points_per_revolution},
                              {"missing_share", s.missing_share},
                              {"second_return_share", s.second_return_share},
                              {"range_bins_m", kRangeBins_m},
                              {"range_share", s.range_share},
                              {"mixed_share", s.mixed_share},
                              {"road_noise_m", s.road_noise_m},
                              {"road_offset_m", s.road_offset_m},
                              {"intensity", s.intensity},
                              {"road_intensity", s.road_intensity},
                              {"road_intensity_spread", s.road_intensity_spread}};
  for (const LaserStatistics& laser : s.lasers) {
    json["lasers"].push_back({{"elevation_deg", laser.elevation_deg},
                              {"points_per_revolution", laser.points_per_revolution},
                              {"missing_share", laser.missing_share},
                              {"road_windows", laser.road_window_count},
                              {"road_noise_m", laser.road_noise_m},
                              {"road_offset_m", laser.road_offset_m},
                              {"road_intensity", laser.mean_road_intensity}});
  }
  return json;
}

}  // namespace roadvec
