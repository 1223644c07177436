#include "tools/inspect/lidar_statistics.h"

#include <gtest/gtest.h>

#include <random>

#include "core/base/angle.h"

namespace roadvec {
namespace {

constexpr double kHeight_m = 1.7;

/// A revolution over a flat road: lasers 0 to 7 look 4 to 18 degrees down, every 0.2 degrees of azimuth.
class FlatRoad {
 public:
  double noise_m = 0, high_laser_m = 0;  ///< sigma of the range; how much too high laser 3 lies

  void fill(Sweep& sweep) {
    std::mt19937 engine(7);
    std::normal_distribution<double> normal;
    sweep.returns.clear();
    sweep.complete = true;
    sweep.start = {0};
    sweep.end = {100'000'000};
    for (int step = 0; step < 1800; ++step) {
      for (std::uint8_t laser = 0; laser < 8; ++laser) {
        const double elevation_rad = -rad_from_deg(4 + 2 * laser), azimuth_rad = rad_from_deg(0.2 * step);
        const double range_m = kHeight_m / -std::sin(elevation_rad) + noise_m * normal(engine);
        sweep.returns.push_back(at(range_m, elevation_rad, azimuth_rad, laser));
        if (laser == 3) sweep.returns.back().z_m += static_cast<float>(high_laser_m);
      }
    }
  }
  static Return at(double range_m, double elevation_rad, double azimuth_rad, std::uint8_t laser) {
    const double flat_m = range_m * std::cos(elevation_rad);
    return {.x_m = static_cast<float>(flat_m * std::cos(azimuth_rad)),
            .y_m = static_cast<float>(-flat_m * std::sin(azimuth_rad)),
            .z_m = static_cast<float>(range_m * std::sin(elevation_rad)),
            .azimuth_rad = static_cast<float>(azimuth_rad),
            .laser = laser,
            .intensity = static_cast<std::uint8_t>(10 * laser)};
  }
};

/// The sweep's returns as packets of one reading of the azimuth each.
void add_packets(const Sweep& sweep, StatisticsCollector& collector) {
  for (std::size_t i = 0; i < sweep.returns.size(); i += 8) {
    DecodedPacket packet;
    packet.group_count = 1;
    packet.return_count = 8;
    packet.groups[0].usable = true;
    packet.groups[0].azimuth_cdeg =
        static_cast<std::uint16_t>(std::lround(100 * deg_from_rad(static_cast<double>(sweep.returns[i].azimuth_rad))));
    std::copy_n(sweep.returns.begin() + static_cast<std::ptrdiff_t>(i), 8, packet.returns.begin());
    collector.add({}, packet);
  }
}

LidarStatistics figures_of(FlatRoad& road, int sweeps = 1) {
  StatisticsCollector collector(LidarModel::hdl32e);
  for (int i = 0; i < sweeps; ++i) {
    Sweep& sweep = *collector.claim();
    road.fill(sweep);
    add_packets(sweep, collector);
    collector.publish();
  }
  return collector.figures();
}

TEST(LidarStatistics, noise_put_on_a_flat_road_is_the_noise_found) {
  FlatRoad road;
  road.noise_m = 0.02;
  const LidarStatistics s = figures_of(road);
  EXPECT_NEAR(s.road_noise_m, 0.02, 0.003);
  road.noise_m = 0;
  EXPECT_LT(figures_of(road).road_noise_m, 1e-4);
}

TEST(LidarStatistics, a_laser_that_lies_high_stands_out_of_the_surface) {
  FlatRoad road;
  EXPECT_LT(figures_of(road).road_offset_m, 1e-4);
  road.high_laser_m = 0.05;
  const LidarStatistics s = figures_of(road);
  EXPECT_GT(s.road_offset_m, 0.004);
  const auto highest = std::ranges::max_element(s.lasers, {}, &LaserStatistics::road_offset_m);
  EXPECT_NEAR(highest->elevation_deg, -10, 0.4);
}

TEST(LidarStatistics, points_are_counted_by_laser_from_the_highest_and_by_range) {
  FlatRoad road;
  const LidarStatistics s = figures_of(road, 2);
  ASSERT_EQ(s.lasers.size(), 8U);
  EXPECT_NEAR(s.lasers.front().elevation_deg, -4, 1e-3);
  EXPECT_NEAR(s.lasers.back().elevation_deg, -18, 1e-3);
  EXPECT_NEAR(s.lasers.front().points_per_revolution, 1800, 2);
  EXPECT_NEAR(s.points_per_revolution, 8 * 1800, 16);
  EXPECT_NEAR(s.range_share[3], 1.0 / 8, 1e-9) << "4 degrees: 24.4 m";
  EXPECT_NEAR(s.range_share[2], 2.0 / 8, 1e-9) << "6 and 8 degrees: 16.3 and 12.2 m";
  EXPECT_EQ(s.intensity[2], 30);
}

TEST(LidarStatistics, equal_sweeps_are_told_from_distinct_ones) {
  FlatRoad road;
  const LidarStatistics s = figures_of(road, 3);
  EXPECT_EQ(s.sweep_count, 3U);
  EXPECT_EQ(s.distinct_sweep_count, 1U);
}

TEST(LidarStatistics, a_return_in_mid_air_between_two_walls_is_told_from_a_clean_edge) {
  const auto mixed_share = [](double middle_m) {
    StatisticsCollector collector(LidarModel::hdl32e);
    Sweep& sweep = *collector.claim();
    sweep.complete = true;
    sweep.end = {100'000'000};
    for (const double range_m : {10.0, 10.0, 10.0, middle_m, 11.5, 11.5, 11.5}) {
      const double azimuth_rad = rad_from_deg(0.2 * static_cast<double>(sweep.returns.size()));
      sweep.returns.push_back(FlatRoad::at(range_m, 0.0, azimuth_rad, 0));
    }
    collector.publish();
    return collector.figures().mixed_share;
  };
  EXPECT_EQ(mixed_share(10.8), 1.0);
  EXPECT_EQ(mixed_share(10.0), 0.0);
}

TEST(LidarStatistics, firings_without_a_return_and_second_returns_are_counted_by_packet) {
  StatisticsCollector collector(LidarModel::vlp16);
  DecodedPacket packet;
  packet.group_count = 6;  // dual return: 6 groups of two blocks, 12 firings of each laser
  for (const ReturnKind kind : {ReturnKind::both, ReturnKind::strongest, ReturnKind::last}) {
    packet.returns[packet.return_count].laser = 5;
    packet.returns[packet.return_count++].kind = kind;
  }
  RawPacket raw;
  collector.add(raw, packet);
  raw.arrived = {663'600};
  raw.bytes[kDeviceTimeOffset] = 0x98;  // 664 us
  raw.bytes[kDeviceTimeOffset + 1] = 0x02;
  collector.add(raw, packet);
  const LidarStatistics s = collector.figures();
  EXPECT_NEAR(s.missing_share, 1 - 2.0 / (12 * 16), 1e-12);
  EXPECT_EQ(s.second_return_share, 0.5);
  EXPECT_NEAR(s.arrival_step_us[1], 663.6, 1e-6);
  EXPECT_EQ(s.device_step_us[1], 664);
}

TEST(LidarStatistics, tables_have_a_column_for_each_recording) {
  FlatRoad road;
  LidarStatistics a = figures_of(road), b = a;
  a.path = "one";
  b.path = "two";
  const std::string text = statistics_markdown({a, b});
  EXPECT_NE(text.find("| | one | two |\n|---|---|---|\n"), std::string::npos) << text;
  EXPECT_NE(text.find("| points per revolution | 14408 | 14408 |"), std::string::npos) << text;
  EXPECT_NE(text.find("| 0 | -4.00 | 1801 |"), std::string::npos) << text;
}

}  // namespace
}  // namespace roadvec
