#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "core/sensor/lidar.h"
#include "drivers/velodyne/assemble.h"
#include "drivers/velodyne/decode.h"
#include "drivers/velodyne/model.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {

inline constexpr std::array<double, 8> kRangeBins_m{0, 5, 10, 20, 30, 50, 80, 120};  ///< where each begins

struct LaserStatistics {
  double elevation_deg = 0;  ///< mean of its returns
  double points_per_revolution = 0;
  double missing_share = 0;           ///< firings without a return
  std::size_t road_window_count = 0;  ///< of eight firings on the road ahead
  double road_noise_m = 0;            ///< median over them: scatter of the ranges about a parabola
  double road_offset_m = 0;           ///< mean height over the surface fitted to the road through all lasers
  double mean_road_intensity = 0;
};

/// What a recording's LiDAR gives, in figures by which a simulated head is compared with a real one.
struct LidarStatistics {
  std::string path, model;
  double revolution_count = 0;                            ///< what the head turned while packets came
  std::size_t sweep_count = 0, distinct_sweep_count = 0;  ///< as cut by SweepAssembler
  double revolutions_per_s = 0, points_per_revolution = 0, packets_per_revolution = 0;
  double missing_share = 0;
  double second_return_share = 0;                             ///< of the firings with a return, those with two
  std::array<double, 3> arrival_step_us{}, device_step_us{};  ///< quantiles 5, 50, 95 % from packet to packet
  std::array<double, kRangeBins_m.size()> range_share{};
  std::array<int, 5> intensity{}, road_intensity{};  ///< quantiles 5, 25, 50, 75, 95 %
  double mixed_share = 0;  ///< of the jumps in range between neighbours, those with a return in mid-air
  double road_noise_m = 0, road_offset_m = 0;  ///< over the lasers: median; root mean square
  double road_intensity_spread = 0;            ///< standard deviation of the lasers' mean
  std::vector<LaserStatistics> lasers;         ///< those with returns, highest first
};

/// Gathers the figures: packets by add(), sweeps as a SweepSink.
class StatisticsCollector final : public SweepSink {
 public:
  explicit StatisticsCollector(LidarModel model);

  void add(const RawPacket& raw, const DecodedPacket& packet);
  Sweep* claim() noexcept override { return &sweep_; }
  void publish() noexcept override;
  [[nodiscard]] LidarStatistics figures() const;

 private:
  struct Laser {
    std::uint64_t firing_count = 0, answered_count = 0, return_count = 0;
    double elevation_sum_deg = 0, offset_sum_m = 0, road_intensity_sum = 0;
    std::uint64_t offset_count = 0, road_count = 0;
    std::vector<double> noises_m;
  };
  using Histogram = std::array<std::uint64_t, 256>;

  void turn_to(std::uint16_t azimuth_cdeg);
  void add_return(const Return& r);
  void add_jumps(const std::vector<Return>& line);
  void add_noise(const std::vector<Return>& line, double road_z_m);
  void add_road();

  const ModelFacts& facts_;
  Sweep sweep_;
  std::vector<Laser> lasers_;
  std::vector<std::vector<Return>> lines_;  ///< of the sweep, by laser
  std::vector<double> arrival_steps_us_, device_steps_us_;
  SensorTime last_arrived_;
  std::uint32_t last_device_us_ = 0;
  int last_azimuth_cdeg_ = -1;
  double turned_cdeg_ = 0;
  std::uint64_t step_count_ = 0, sweep_count_ = 0;
  std::uint64_t packet_count_ = 0, double_count_ = 0, clean_jump_count_ = 0, mixed_count_ = 0;
  std::array<std::uint64_t, kRangeBins_m.size()> ranges_{};
  Histogram intensity_{}, road_intensity_{};
  std::set<std::uint64_t> fingerprints_;
};

/// Markdown tables with a column, or a group of them, for each recording.
[[nodiscard]] std::string statistics_markdown(const std::vector<LidarStatistics>& recordings);
[[nodiscard]] nlohmann::ordered_json json_of(const LidarStatistics& statistics);

}  // namespace roadvec
