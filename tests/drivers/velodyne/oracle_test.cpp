#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>
#include <set>

#include "drivers/velodyne/pcap_reader.h"
#include "tests/drivers/velodyne/packets.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

// The shared recordings come with the decodes of an independent decoder (tests/support/recordings.h). Its azimuth is
// rounded to 0.01 degrees, which is 9 mm at 100 m; a firing is found by its time, which both derive from the sensor's
// own stamp.

struct OraclePoint {
  double x_m, y_m, z_m, intensity;
  std::int64_t device_ns;  ///< past the hour
  int ring;
  ReturnKind kind;
};

std::vector<OraclePoint> read_oracle(const std::string& path) {
  std::vector<OraclePoint> points;
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(::popen(("xz -dc '" + path + "'").c_str(), "r"), ::pclose);
  double device_s = 0;
  std::array<char, 256> line{};
  while (file && std::fgets(line.data(), line.size(), file.get()) != nullptr) {
    if (std::sscanf(line.data(), "#scan %*d device=%lf", &device_s) == 1) continue;
    OraclePoint point{};
    double time_s = 0;
    int flags = 0;
    if (std::sscanf(line.data(), "%*d,%lf,%lf,%lf,%lf,%lf,%*d,%d,%d", &point.x_m, &point.y_m, &point.z_m,
                    &point.intensity, &time_s, &point.ring, &flags) != 7) {
      ADD_FAILURE() << "not understood: " << line.data();
      return {};
    }
    point.device_ns = std::llround(std::fmod(device_s, 3600.0) * 1e9) + std::llround(time_s * 1e9);
    point.kind = static_cast<ReturnKind>(flags);  // 1 strongest, 2 last, 3 both
    points.push_back(point);
  }
  return points;
}

/// Rings count lasers from the lowest beam up.
std::vector<int> rings(const Calibration& calibration) {
  std::vector<std::size_t> by_elevation(calibration.lasers.size());
  std::iota(by_elevation.begin(), by_elevation.end(), std::size_t{0});
  std::ranges::stable_sort(by_elevation, {},
                           [&](std::size_t laser) { return calibration.lasers[laser].elevation_rad; });
  std::vector<int> ring(by_elevation.size());
  for (std::size_t i = 0; i < by_elevation.size(); ++i) ring[by_elevation[i]] = static_cast<int>(i);
  return ring;
}

using ReturnsByFiring = std::map<std::pair<std::int64_t, int>, std::vector<Return>>;  // device time, ring

struct Recorded {
  ReturnsByFiring firings;
  /// Packets in which the head leaves out a sector, which the oracle takes for a fast turn: not compared.
  std::set<std::int64_t> leaping_ns;
};
bool in_leaping_packet(const Recorded& recorded, std::int64_t device_ns) {
  constexpr std::int64_t kPacket_ns = 663'000;  // of a VLP-32C
  const auto next = recorded.leaping_ns.upper_bound(device_ns + 500);
  return next != recorded.leaping_ns.begin() && device_ns - *std::prev(next) < kPacket_ns;
}

/// What is compared, and where the oracle differs by what is known of it.
struct Comparison {
  const char* pcap;
  const char* csv;
  LidarModel model;
  bool dual = false;
  const char* calibration = nullptr;  ///< null: built in
  double tolerance_m = 0.010;
  double near_tolerance_m = 0.010;  ///< below 25.04 m, where an HDL-64E is corrected by two points
  double tolerance_rad = 0;         ///< of the azimuth, where that is more
  /// Between the groups of a packet; 0: as we have it. And before the stamp.
  std::uint32_t group_period_ns = 0, before_stamp_ns = 0;
};

std::int64_t oracle_time_ns(const Comparison& c, const RawPacket& packet, const Return& r) {
  std::int64_t time_ns = std::int64_t{device_time_us(packet.bytes)} * 1000 + r.time_ns - c.before_stamp_ns;
  const std::int64_t group = r.time_ns / facts_of(c.model).group_period_ns;
  if (c.group_period_ns != 0) time_ns += group * (std::int64_t{c.group_period_ns} - facts_of(c.model).group_period_ns);
  return time_ns;
}

Recorded decode_recording(const std::string& path, const Comparison& c, const Calibration& calibration) {
  Recorded recorded;
  LidarCounters counters;
  PacketDecoder decoder(c.model, calibration, {.maybe_follow_turn = true}, counters);
  DecodedPacket decoded;
  const std::vector<int> ring = rings(calibration);
  auto reader = PcapReader::open(path, {}, counters);
  EXPECT_TRUE(reader.has_value());
  std::span<const RawPacket> batch;
  while (reader && (*reader)->read(batch, {}) == ReadResult::packets) {
    for (const RawPacket& packet : batch) {
      EXPECT_TRUE(decoder.decode(packet.bytes, decoded));
      if (decoder.duration_ns(decoded) > 5'000'000) {
        recorded.leaping_ns.insert(std::int64_t{device_time_us(packet.bytes)} * 1000);
        continue;
      }
      for (std::uint32_t i = 0; i < decoded.return_count; ++i) {
        const Return& r = decoded.returns[i];
        recorded.firings[{oracle_time_ns(c, packet, r), ring[r.laser]}].push_back(r);
      }
    }
  }
  return recorded;
}

/// The return nearest to the oracle's among those of its ring within 1 us.
const Return* find(const ReturnsByFiring& firings, const OraclePoint& point, double& distance_m) {
  constexpr std::int64_t kTolerance_ns = 1000;
  const Return* nearest = nullptr;
  distance_m = 1e9;
  for (auto it = firings.lower_bound({point.device_ns - kTolerance_ns, 0});
       it != firings.end() && it->first.first <= point.device_ns + kTolerance_ns; ++it) {
    if (it->first.second != point.ring) continue;
    for (const Return& r : it->second) {
      const double d = std::hypot(r.x_m - point.x_m, r.y_m - point.y_m, r.z_m - point.z_m);
      if (d < distance_m) nearest = &r, distance_m = d;
    }
  }
  return nearest;
}

Calibration calibration_in(const Comparison& c) {
  if (c.calibration == nullptr) return *built_in_calibration(c.model);
  auto calibration = calibration_for(c.model, *recording(c.calibration));
  EXPECT_TRUE(calibration) << calibration.error().message;
  return *calibration;
}

void expect_oracle(const Comparison& c) {
  const auto maybe_pcap = recording(c.pcap), maybe_csv = recording(c.csv);
  if (!maybe_pcap || !maybe_csv) return;
  const std::vector<OraclePoint> points = read_oracle(*maybe_csv);
  const Recorded recorded = decode_recording(*maybe_pcap, c, calibration_in(c));
  ASSERT_GT(points.size(), 10'000U);
  double worst_m = 0, worst_excess_m = -1, worst_intensity = 0;
  std::size_t missing_count = 0, other_kind_count = 0, compared_count = 0;
  std::int64_t first_ns = points.front().device_ns, last_ns = first_ns;
  for (const OraclePoint& point : points) {
    if (in_leaping_packet(recorded, point.device_ns)) continue;
    ++compared_count;
    double distance_m = 0;
    const Return* const found = find(recorded.firings, point, distance_m);
    if (found == nullptr) {
      ++missing_count;
      continue;
    }
    const double range_m = std::hypot(point.x_m, point.y_m, point.z_m);
    const double tolerance_m = range_m < 25.5 ? c.near_tolerance_m : std::max(c.tolerance_m, range_m * c.tolerance_rad);
    worst_m = std::max(worst_m, distance_m);
    worst_excess_m = std::max(worst_excess_m, distance_m - tolerance_m);
    worst_intensity = std::max(worst_intensity, std::abs(found->intensity - point.intensity));
    if (found->kind != (c.dual ? point.kind : ReturnKind::single)) ++other_kind_count;
    first_ns = std::min(first_ns, point.device_ns);
    last_ns = std::max(last_ns, point.device_ns);
  }
  EXPECT_EQ(missing_count, 0U);
  EXPECT_EQ(other_kind_count, 0U);
  EXPECT_LT(worst_excess_m, 0.0) << "farthest " << worst_m << " m";
  EXPECT_LE(worst_intensity, 0.501);
  std::size_t ours = 0;
  for (const auto& [firing, returns] : recorded.firings) {
    if (firing.first >= first_ns - 500 && firing.first <= last_ns + 500) ours += returns.size();
  }
  EXPECT_EQ(ours, compared_count);
  EXPECT_GT(compared_count, points.size() * 97 / 100);
}

TEST(Oracle, finds_the_points_of_an_hdl32e_within_a_centimetre_and_a_microsecond) {
  expect_oracle(
      {.pcap = "velodyne/hdl32e_monterey.pcap", .csv = "velodyne/oracle_hdl32e.csv.xz", .model = LidarModel::hdl32e});
}
TEST(Oracle, finds_the_points_of_a_vlp16_though_its_packets_claim_another_model) {
  expect_oracle(
      {.pcap = "velodyne/vlp16_says_hdl32e.pcap", .csv = "velodyne/oracle_vlp16.csv.xz", .model = LidarModel::vlp16});
}
TEST(Oracle, finds_both_returns_of_a_vlp16_in_dual_mode) {
  expect_oracle({.pcap = "velodyne/vlp16_dual.pcap",
                 .csv = "velodyne/oracle_vlp16dual.csv.xz",
                 .model = LidarModel::vlp16,
                 .dual = true});
}
TEST(Oracle, finds_the_points_of_a_vlp32c) {
  expect_oracle({.pcap = "velodyne/vlp32c.pcap", .csv = "velodyne/oracle_vlp32c.csv.xz", .model = LidarModel::vlp32c});
}
TEST(Oracle, finds_the_points_of_a_vls128) {
  // The oracle spaces the groups of a packet by 53.3 us, where the sensor's own clock has 55.3 us: its lasers follow
  // the head 4 % too fast, up to 0.7 hundredths of a degree, and then it rounds by half a hundredth. Its times begin 7
  // us before the stamp.
  expect_oracle({.pcap = "velodyne/vls128.pcap",
                 .csv = "velodyne/oracle_vls128.csv.xz",
                 .model = LidarModel::vls128,
                 .tolerance_rad = rad_from_deg(0.012),
                 .group_period_ns = 53'333,
                 .before_stamp_ns = 7'000});
}
TEST(Oracle, finds_both_returns_of_an_hdl64e_s3_with_a_ros_calibration) {
  expect_oracle({.pcap = "velodyne/hdl64e_s3_dual_6_revolutions.pcap",
                 .csv = "velodyne/oracle_hdl64.csv.xz",
                 .model = LidarModel::hdl64e_s3,
                 .dual = true,
                 .calibration = "velodyne/hdl64e_s3_xiesc.yaml",
                 .near_tolerance_m = 0.030});
}

}  // namespace
}  // namespace roadvec
