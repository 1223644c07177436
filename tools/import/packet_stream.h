#pragma once

#include <array>
#include <cstdint>

#include "drivers/velodyne/packet.h"
#include "tools/import/firings.h"
#include "tools/recording/pcap_writer.h"

namespace roadvec {

inline constexpr std::size_t kFiringsPerPacket = 6;

/// Packs firings into HDL-64E S2 packets and writes those to a capture.
class PacketStream {
 public:
  explicit PacketStream(PcapWriter& pcap) : pcap_(pcap) {}

  /// Times must grow. Where firings are missing, the packet under way is filled up with firings without echoes.
  void add(const Firing& firing);
  /// Fills up the last packet and sends it.
  void finish();
  [[nodiscard]] std::uint64_t packet_count() const { return packet_count_; }

 private:
  void put(SensorTime time, int cell);
  void send();

  PcapWriter& pcap_;
  RawPacket packet_;
  std::size_t firing_count_ = 0;  ///< in packet_
  SensorTime last_time_;
  int last_cell_ = 0;
  std::uint64_t packet_count_ = 0;
};

}  // namespace roadvec
