#include <benchmark/benchmark.h>

#include "tests/bench/decode_packets.h"

namespace roadvec {
namespace {

/// An HDL-64E S2 recording unpacked beside the others is used; the shared archive is not unpacked here.
std::vector<RawPacket> packets_of(LidarModel model) {
  switch (model) {
    case LidarModel::hdl32e:
      return bench_packets(model, "velodyne/hdl32e_monterey.pcap");
    case LidarModel::vlp16:
      return bench_packets(model, "velodyne/vlp16_says_hdl32e.pcap");
    case LidarModel::hdl64e_s3:
      return bench_packets(model, "velodyne/hdl64e_s3_dual_6_revolutions.pcap");
    case LidarModel::vlp32c:
      return bench_packets(model, "velodyne/vlp32c.pcap");
    case LidarModel::vls128:
      return bench_packets(model, "velodyne/vls128.pcap");
    default:
      return bench_packets(model, "kitti_0005/lidar.pcap");
  }
}

/// Every correction in use, as in a real db.xml.
Calibration corrected(Calibration calibration) {
  for (LaserCalibration& laser : calibration.lasers) {
    laser.distance_m = 1.3;
    laser.distance_x_m = 1.33;
    laser.distance_y_m = 1.31;
    laser.focal_distance_m = 12.0;
    laser.focal_slope = 1.2;
  }
  return calibration;
}

Calibration bench_calibration(LidarModel model) {
  return facts_of(model).needs_calibration() ? corrected(ideal_hdl64e()) : calibration_of(model);
}

void report(benchmark::State& state, std::size_t returns) {
  state.counters["returns_per_packet"] = static_cast<double>(returns) / static_cast<double>(state.iterations());
  state.SetItemsProcessed(state.iterations());
}

/// One packet to returns; the time is that of one packet.
void decode(benchmark::State& state, LidarModel model) {
  const std::vector<RawPacket> packets = packets_of(model);
  LidarCounters counters;
  PacketDecoder decoder(model, bench_calibration(model), {}, counters);
  DecodedPacket decoded;
  std::size_t i = 0, returns = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(decoder.decode(packets[i].bytes, decoded));
    returns += decoded.return_count;
    if (++i == packets.size()) i = 0;
  }
  report(state, returns);
}

class OneSlot final : public SweepSink {
 public:
  explicit OneSlot(LidarModel model) { slot_.returns.reserve(max_returns_per_sweep(model)); }
  Sweep* claim() noexcept override { return &slot_; }
  void publish() noexcept override { returns_ += slot_.returns.size(); }
  std::size_t returns_ = 0;

 private:
  Sweep slot_;
};

/// The same with clock and assembly: everything between the socket and the ring.
void decode_and_assemble(benchmark::State& state, LidarModel model) {
  const std::vector<RawPacket> packets = packets_of(model);
  LidarCounters counters;
  OneSlot sink(model);
  SweepDecoder driver(model, bench_calibration(model), {}, sink, counters);
  std::size_t i = 0;
  for (auto _ : state) {
    driver.add(packets[i]);
    if (++i == packets.size()) i = 0;
  }
  report(state, sink.returns_);
}

BENCHMARK_CAPTURE(decode, HDL_64E_S2, LidarModel::hdl64e_s2);
BENCHMARK_CAPTURE(decode, HDL_64E_S3_dual, LidarModel::hdl64e_s3);
BENCHMARK_CAPTURE(decode, HDL_32E, LidarModel::hdl32e);
BENCHMARK_CAPTURE(decode, VLP_16, LidarModel::vlp16);
BENCHMARK_CAPTURE(decode, VLP_32C, LidarModel::vlp32c);
BENCHMARK_CAPTURE(decode, VLS_128, LidarModel::vls128);
BENCHMARK_CAPTURE(decode_and_assemble, HDL_64E_S2, LidarModel::hdl64e_s2);
BENCHMARK_CAPTURE(decode_and_assemble, HDL_64E_S3_dual, LidarModel::hdl64e_s3);
BENCHMARK_CAPTURE(decode_and_assemble, HDL_32E, LidarModel::hdl32e);
BENCHMARK_CAPTURE(decode_and_assemble, VLP_16, LidarModel::vlp16);
BENCHMARK_CAPTURE(decode_and_assemble, VLP_32C, LidarModel::vlp32c);
BENCHMARK_CAPTURE(decode_and_assemble, VLS_128, LidarModel::vls128);

}  // namespace
}  // namespace roadvec
