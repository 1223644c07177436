#pragma once

#include <cstdint>
#include <span>

#include "core/base/time.h"
#include "tools/recording/output_file.h"

namespace roadvec {

/// Writes UDP datagrams as Ethernet frames into a nanosecond pcap file, from a Velodyne's factory address to everyone.
class PcapWriter {
 public:
  explicit PcapWriter(OutputFile file);

  void write(std::span<const std::uint8_t> payload, SensorTime arrived);
  [[nodiscard]] std::uint64_t size_bytes() const { return file_.size_bytes(); }
  [[nodiscard]] Expected<void> close() { return file_.close(); }

 private:
  OutputFile file_;
};

}  // namespace roadvec
