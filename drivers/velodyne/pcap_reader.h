#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "drivers/recording/capture_file.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/packet_source.h"

namespace roadvec {

struct PcapReaderOptions {
  int port = kDataPort;               ///< UDP destination; 0: data packets to any port
  int position_port = kPositionPort;  ///< likewise; 0: none are read
  std::optional<std::uint32_t> source_ipv4{};
};

/// Reads data and position packets from a capture (see CaptureFile) as fast as asked. A cut-off end is an end with a
/// warning; damage, a second sensor on the port when source_ipv4 is not set, and a capture without a single data packet
/// are told by ReadResult::failed after every packet before was delivered.
class PcapReader final : public PacketSource {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<PcapReader>> open(const std::filesystem::path& path,
                                                                  const PcapReaderOptions& options,
                                                                  LidarCounters& counters);

  /// Never waits; `timeout` is not used.
  ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] std::span<const RawPositionPacket> positions() const noexcept override {
    return std::span(positions_).first(position_count_);
  }
  [[nodiscard]] const Senders* senders() const noexcept override { return &senders_; }
  [[nodiscard]] std::string_view error() const noexcept override { return error_; }
  [[nodiscard]] std::string_view warning() const noexcept override { return warning_; }

  /// Not IPv4 UDP, or to another port.
  [[nodiscard]] std::uint64_t other_frame_count() const { return other_frame_count_; }

 private:
  PcapReader(CaptureFile file, std::string name, const PcapReaderOptions& options, LidarCounters& counters);
  void take(const CaptureFile::Frame& frame) noexcept;
  void take_data(const UdpDatagram& datagram, SensorTime arrived) noexcept;
  void take_position(const UdpDatagram& datagram, SensorTime arrived) noexcept;
  void finish(CaptureFile::Next how) noexcept;
  [[nodiscard]] std::string nothing_found() const;

  CaptureFile file_;
  std::string name_;
  PcapReaderOptions options_;
  LidarCounters& counters_;
  Senders senders_;
  std::vector<RawPacket> packets_;
  std::vector<RawPositionPacket> positions_;
  std::size_t packet_count_ = 0, position_count_ = 0;
  std::string error_, warning_;
  std::optional<ReadResult> finished_;  ///< what every read() says from now on
  std::uint64_t other_frame_count_ = 0;
};

}  // namespace roadvec
