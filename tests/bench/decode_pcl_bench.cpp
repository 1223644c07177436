#include <benchmark/benchmark.h>
#include <pcl/io/hdl_grabber.h>

#include <cstring>

#include "tests/bench/decode_packets.h"

namespace roadvec {
namespace {

// Ours against PCL's grabber: the same packets, one process, no calibration beyond the angles on either side (PCL
// knows only part of db.xml). PCL's own entry, toPointClouds(), is private and fills three clouds at once; `pcl_points`
// is the least that it can cost: its point formula alone, over every echo, into one cloud of reserved memory.

class OpenGrabber final : public pcl::HDLGrabber {
 public:
  /// PCL fills the table of 32 lasers by itself; the lower bank of an HDL-64E takes the same angles.
  OpenGrabber() {
    for (int laser = 0; laser < kLanesPerBlock; ++laser) {
      laser_corrections_[kLanesPerBlock + laser] = laser_corrections_[laser];
    }
  }

  /// One packet to points; returns how many.
  std::size_t decode(const PacketBytes& bytes, int bank_count) {
    HDLDataPacket packet;
    std::memcpy(&packet, bytes.data(), sizeof packet);
    cloud_.clear();
    for (int block = 0; block < kBlocksPerPacket; ++block) {
      const auto& firing = packet.firingData[block];
      const int first_laser = bank_count == 2 && firing.blockIdentifier == BLOCK_32_TO_63 ? kLanesPerBlock : 0;
      for (int lane = 0; lane < kLanesPerBlock; ++lane) {
        if (firing.laserReturns[lane].distance == 0) continue;
        pcl::PointXYZI point;
        computeXYZI(point, firing.rotationalPosition, firing.laserReturns[lane],
                    laser_corrections_[first_laser + lane]);
        cloud_.push_back(point);
      }
    }
    return cloud_.size();
  }

 private:
  pcl::PointCloud<pcl::PointXYZI> cloud_ = reserved();
  static pcl::PointCloud<pcl::PointXYZI> reserved() {
    pcl::PointCloud<pcl::PointXYZI> cloud;
    cloud.reserve(static_cast<std::size_t>(kBlocksPerPacket) * kLanesPerBlock);
    return cloud;
  }
};

void pcl_points(benchmark::State& state, LidarModel model, const char* recording) {
  const std::vector<RawPacket> packets = bench_packets(model, recording);
  OpenGrabber grabber;
  std::size_t i = 0, returns = 0;
  for (auto _ : state) {
    returns += grabber.decode(packets[i].bytes, facts_of(model).bank_count);
    if (++i == packets.size()) i = 0;
  }
  state.counters["returns_per_packet"] = static_cast<double>(returns) / static_cast<double>(state.iterations());
}

void ours(benchmark::State& state, LidarModel model, const char* recording) {
  const std::vector<RawPacket> packets = bench_packets(model, recording);
  LidarCounters counters;
  PacketDecoder decoder(model, calibration_of(model), {}, counters);
  DecodedPacket decoded;
  std::size_t i = 0, returns = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(decoder.decode(packets[i].bytes, decoded));
    returns += decoded.return_count;
    if (++i == packets.size()) i = 0;
  }
  state.counters["returns_per_packet"] = static_cast<double>(returns) / static_cast<double>(state.iterations());
}

constexpr const char* kHdl64 = "kitti_0005/lidar.pcap";  // absent unless unpacked: then a synthetic room
constexpr const char* kHdl64Dual = "velodyne/hdl64e_s3_dual_6_revolutions.pcap";
constexpr const char* kHdl32 = "velodyne/hdl32e_monterey.pcap";
constexpr const char* kVlp16 = "velodyne/vlp16_says_hdl32e.pcap";
constexpr const char* kVlp32c = "velodyne/vlp32c.pcap";
BENCHMARK_CAPTURE(ours, HDL_64E_S2, LidarModel::hdl64e_s2, kHdl64);
BENCHMARK_CAPTURE(pcl_points, HDL_64E_S2, LidarModel::hdl64e_s2, kHdl64);
BENCHMARK_CAPTURE(ours, HDL_64E_S3_dual, LidarModel::hdl64e_s3, kHdl64Dual);
BENCHMARK_CAPTURE(pcl_points, HDL_64E_S3_dual, LidarModel::hdl64e_s3, kHdl64Dual);
BENCHMARK_CAPTURE(ours, HDL_32E, LidarModel::hdl32e, kHdl32);
BENCHMARK_CAPTURE(pcl_points, HDL_32E, LidarModel::hdl32e, kHdl32);
BENCHMARK_CAPTURE(ours, VLP_16, LidarModel::vlp16, kVlp16);
BENCHMARK_CAPTURE(pcl_points, VLP_16, LidarModel::vlp16, kVlp16);
BENCHMARK_CAPTURE(ours, VLP_32C, LidarModel::vlp32c, kVlp32c);
BENCHMARK_CAPTURE(pcl_points, VLP_32C, LidarModel::vlp32c, kVlp32c);

}  // namespace
}  // namespace roadvec
