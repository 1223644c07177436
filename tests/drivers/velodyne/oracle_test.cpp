#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>

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

ReturnsByFiring decode_recording(const std::string& path, LidarModel model, const Calibration& calibration) {
  ReturnsByFiring firings;
  LidarCounters counters;
  PacketDecoder decoder(model, calibration, {}, counters);
  DecodedPacket decoded;
  const std::vector<int> ring = rings(calibration);
  auto reader = PcapReader::open(path, {}, counters);
  EXPECT_TRUE(reader.has_value());
  std::span<const RawPacket> batch;
  while (reader && (*reader)->read(batch, {}) == ReadResult::packets) {
    for (const RawPacket& packet : batch) {
      EXPECT_TRUE(decoder.decode(packet.bytes, decoded));
      for (std::uint32_t i = 0; i < decoded.return_count; ++i) {
        const Return& r = decoded.returns[i];
        firings[{std::int64_t{device_time_us(packet.bytes)} * 1000 + r.time_ns, ring[r.laser]}].push_back(r);
      }
    }
  }
  return firings;
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

void expect_oracle(const char* pcap, const char* csv, LidarModel model, bool dual) {
  const auto maybe_pcap = recording(pcap), maybe_csv = recording(csv);
  if (!maybe_pcap || !maybe_csv) return;
  const std::vector<OraclePoint> points = read_oracle(*maybe_csv);
  const ReturnsByFiring firings = decode_recording(*maybe_pcap, model, calibration_of(model));
  ASSERT_GT(points.size(), 10'000U);
  double worst_m = 0, worst_intensity = 0;
  std::size_t missing = 0, other_kind = 0;
  std::int64_t first_ns = points.front().device_ns, last_ns = first_ns;
  for (const OraclePoint& point : points) {
    double distance_m = 0;
    const Return* const found = find(firings, point, distance_m);
    if (found == nullptr) {
      ++missing;
      continue;
    }
    worst_m = std::max(worst_m, distance_m);
    worst_intensity = std::max(worst_intensity, std::abs(found->intensity - point.intensity));
    if (found->kind != (dual ? point.kind : ReturnKind::single)) ++other_kind;
    first_ns = std::min(first_ns, point.device_ns);
    last_ns = std::max(last_ns, point.device_ns);
  }
  EXPECT_EQ(missing, 0U);
  EXPECT_EQ(other_kind, 0U);
  EXPECT_LT(worst_m, 0.010);
  EXPECT_LE(worst_intensity, 0.5);
  std::size_t ours = 0;
  for (const auto& [firing, returns] : firings) {
    if (firing.first >= first_ns - 500 && firing.first <= last_ns + 500) ours += returns.size();
  }
  EXPECT_EQ(ours, points.size());
}

TEST(OracleHdl32e, finds_the_same_points_within_a_centimetre_and_a_microsecond) {
  expect_oracle("velodyne/hdl32e_monterey.pcap", "velodyne/oracle_hdl32e.csv.xz", LidarModel::hdl32e, false);
}
TEST(OracleVlp16, finds_the_same_points_though_the_packets_claim_another_model) {
  expect_oracle("velodyne/vlp16_says_hdl32e.pcap", "velodyne/oracle_vlp16.csv.xz", LidarModel::vlp16, false);
}
TEST(OracleVlp16, finds_both_returns_of_the_dual_mode) {
  expect_oracle("velodyne/vlp16_dual.pcap", "velodyne/oracle_vlp16dual.csv.xz", LidarModel::vlp16, true);
}

}  // namespace
}  // namespace roadvec
