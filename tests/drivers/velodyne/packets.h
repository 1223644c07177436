#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "core/base/angle.h"
#include "drivers/velodyne/assemble.h"
#include "drivers/velodyne/packet.h"
#include "drivers/velodyne/sweep_decoder.h"

namespace roadvec {

inline void put_u16(PacketBytes& bytes, std::size_t at, unsigned value) {
  bytes[at] = static_cast<std::uint8_t>(value);
  bytes[at + 1] = static_cast<std::uint8_t>(value >> 8);
}
inline void put_device_time_us(PacketBytes& bytes, std::uint32_t us) {
  put_u16(bytes, kDeviceTimeOffset, us & 0xFFFF);
  put_u16(bytes, kDeviceTimeOffset + 2, us >> 16);
}
inline void put_azimuth_cdeg(PacketBytes& bytes, int block, unsigned azimuth_cdeg) {
  put_u16(bytes, static_cast<std::size_t>(block) * kBlockBytes + kBlockAzimuthOffset, azimuth_cdeg);
}
inline void put_flag(PacketBytes& bytes, int block, unsigned flag) {
  put_u16(bytes, static_cast<std::size_t>(block) * kBlockBytes + kBlockFlagOffset, flag);
}
inline void put_echo(PacketBytes& bytes, int block, int lane, unsigned distance, unsigned intensity) {
  const std::size_t at =
      static_cast<std::size_t>(block) * kBlockBytes + kBlockEchoesOffset + static_cast<std::size_t>(lane) * kEchoBytes;
  put_u16(bytes, at, distance);
  bytes[at + 2] = static_cast<std::uint8_t>(intensity);
}

/// A head that turns steadily and sees every laser's echo at 5 m: what it sends, packet after packet.
class FakeHead {
 public:
  explicit FakeHead(LidarModel model, int turn_per_group_cdeg = 18) : model_(model), turn_cdeg_(turn_per_group_cdeg) {}

  int azimuth_cdeg = 0;
  std::int64_t device_us = 100'000'000;
  SensorTime arrival{1'700'000'000'000'000'000};
  bool dual = false;

  RawPacket next() {
    const ModelFacts& facts = facts_of(model_);
    const GroupLayout layout = group_layout(model_, dual);
    const int group_count = kBlocksPerPacket / layout.block_count;
    const std::int64_t duration_ns = static_cast<std::int64_t>(group_count) * facts.group_period_ns;
    RawPacket packet;
    for (int block = 0; block < group_count * layout.block_count; ++block) {
      const int in_group = block % layout.block_count;
      put_flag(packet.bytes, block, kBankFlags[layout.blocks[static_cast<std::size_t>(in_group)].bank]);
      put_azimuth_cdeg(packet.bytes, block, static_cast<unsigned>(azimuth_cdeg));
      for (int lane = 0; lane < kLanesPerBlock; ++lane) put_echo(packet.bytes, block, lane, 2500, 50);
      if (in_group == layout.block_count - 1) azimuth_cdeg = (azimuth_cdeg + turn_cdeg_) % kFullCircle_cdeg;
    }
    put_device_time_us(packet.bytes, static_cast<std::uint32_t>(device_us % 3'600'000'000));
    if (facts.has_return_mode) packet.bytes[kReturnModeOffset] = dual ? kDualReturnMode : kStrongestReturnMode;
    packet.bytes[kProductIdOffset] = facts.product_id;
    elapsed_ns_ += duration_ns;
    packet.arrived = arrival + elapsed_ns_;
    device_us += duration_ns / 1000;
    return packet;
  }

 private:
  LidarModel model_;
  int turn_cdeg_;
  std::int64_t elapsed_ns_ = 0;
};

/// Keeps every sweep; refuses while `full`.
class SweepCollector : public SweepSink {
 public:
  explicit SweepCollector(LidarModel model) : capacity(max_returns_per_sweep(model)) {}
  Sweep* claim() noexcept override {
    if (full) return nullptr;
    slot_.returns.reserve(capacity);
    return &slot_;
  }
  void publish() noexcept override { sweeps.push_back(slot_); }

  std::size_t capacity;
  bool full = false;
  std::deque<Sweep> sweeps;

 private:
  Sweep slot_;
};

inline constexpr LidarModel kAllModels[] = {LidarModel::hdl64e_s2, LidarModel::hdl64e_s3,   LidarModel::hdl32e,
                                            LidarModel::vlp16,     LidarModel::puck_hi_res, LidarModel::vlp32c,
                                            LidarModel::vls128};

/// A calibration of an ideal HDL-64E: 64 elevations, nothing to correct.
inline Calibration ideal_hdl64e() {
  Calibration calibration;
  for (int laser = 0; laser < 64; ++laser)
    calibration.lasers.push_back({.elevation_rad = rad_from_deg(2.0 - 0.42 * laser)});
  return calibration;
}
inline Calibration calibration_of(LidarModel model) { return built_in_calibration(model).value_or(ideal_hdl64e()); }

/// A whole driver with its counters and sweeps.
struct Bench {
  explicit Bench(LidarModel model, const SweepDecoderOptions& options = {})
      : Bench(model, calibration_of(model), options) {}
  Bench(LidarModel model, const Calibration& calibration, const SweepDecoderOptions& options)
      : sink(model), driver(model, calibration, options, sink, counters) {}
  [[nodiscard]] LidarCounts counts() const { return snapshot(counters); }

  LidarCounters counters;
  SweepCollector sink;
  SweepDecoder driver;
};

}  // namespace roadvec
