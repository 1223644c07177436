#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/frame.h"
#include "drivers/velodyne/packet_source.h"

struct pcap;

namespace roadvec {

struct PcapReaderOptions {
  int port = kDataPort;  ///< UDP destination; 0: data packets to any port
  std::optional<std::uint32_t> source_ipv4{};
};

/// Reads data packets from a capture (pcap in microseconds or nanoseconds, pcapng) as fast as asked. A damaged or cut
/// end is told by ReadResult::failed after every packet before it was delivered.
class PcapReader final : public PacketSource {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<PcapReader>> open(const std::filesystem::path& path,
                                                                  const PcapReaderOptions& options,
                                                                  LidarCounters& counters);
  ~PcapReader() override;
  PcapReader(const PcapReader&) = delete;
  PcapReader& operator=(const PcapReader&) = delete;

  /// Never waits; `timeout` is not used.
  ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] std::string_view error() const noexcept override { return error_; }

  [[nodiscard]] std::uint64_t position_packet_count() const { return position_packet_count_; }  ///< to port 8308
  [[nodiscard]] std::uint64_t fragment_count() const { return fragment_count_; }
  [[nodiscard]] std::uint64_t other_frame_count() const {
    return other_frame_count_;
  }  ///< not IPv4 UDP, or to another port

 private:
  PcapReader(pcap* file, LinkLayer link, std::string name, const PcapReaderOptions& options, LidarCounters& counters);
  [[nodiscard]] bool take(const CapturedFrame& frame, SensorTime arrived, RawPacket& packet) noexcept;

  pcap* file_;
  LinkLayer link_;
  std::string name_;
  PcapReaderOptions options_;
  LidarCounters& counters_;
  std::vector<RawPacket> packets_;
  std::string error_;
  std::optional<ReadResult> finished_;  ///< what every read() says from now on
  std::uint64_t position_packet_count_ = 0, fragment_count_ = 0, other_frame_count_ = 0;
};

}  // namespace roadvec
