#pragma once

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/velodyne/pcap_reader.h"
#include "tests/drivers/velodyne/packets.h"

namespace roadvec {

/// Up to 4000 packets of a recording below ROADVEC_RECORDINGS; where it is absent, of a head that turns in a wavy room
/// in which every laser has an echo.
inline std::vector<RawPacket> bench_packets(LidarModel model, const std::string& recording) {
  constexpr std::size_t kMost = 4000;
  std::vector<RawPacket> packets;
  LidarCounters counters;
  const std::filesystem::path path = std::filesystem::path(ROADVEC_RECORDINGS) / recording;
  if (auto reader = PcapReader::open(path, {}, counters)) {
    std::span<const RawPacket> batch;
    while (packets.size() < kMost && (*reader)->read(batch, {}) == ReadResult::packets) {
      packets.insert(packets.end(), batch.begin(), batch.end());
    }
    return packets;
  }
  FakeHead head(model);
  while (packets.size() < kMost) {
    packets.push_back(head.next());
    for (int block = 0; block < kBlocksPerPacket; ++block) {
      for (int lane = 0; lane < kLanesPerBlock; ++lane) {
        const double range = 6000 + 4000 * std::sin(0.01 * static_cast<double>(packets.size()) + lane);
        put_echo(packets.back().bytes, block, lane, static_cast<unsigned>(range), static_cast<unsigned>(lane));
      }
    }
  }
  return packets;
}

}  // namespace roadvec
