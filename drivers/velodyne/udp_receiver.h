#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "drivers/udp/datagram_socket.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/packet_source.h"

namespace roadvec {

struct UdpReceiverOptions {
  int port = kDataPort;  ///< 0: any free one, see UdpReceiver::port()
  /// Of the position packets; 0: they are not listened to. Taken by another program: told by warning(), and we go on.
  int position_port = 0;
  /// Only packets of this sender are taken (host byte order); empty: those of the first that sends.
  std::optional<std::uint32_t> source_ipv4{};
  /// 16 MB hold about 2.5 s of an HDL-64E: the kernel charges 2304 bytes for each packet (measured).
  int receive_buffer_bytes = 16 << 20;
  /// Bound UDP sockets to take over (systemd socket activation); then the port is not used. -1: none.
  int adopted_fd = -1, adopted_position_fd = -1;
};

/// Reads the sensor's UDP packets from both ports, up to kBatchPackets in one system call. After open() nothing is
/// allocated.
class UdpReceiver final : public PacketSource {
 public:
  /// Fails when the data port is taken or its socket cannot be set up. `counters` outlives the receiver.
  [[nodiscard]] static Expected<std::unique_ptr<UdpReceiver>> open(const UdpReceiverOptions& options,
                                                                   LidarCounters& counters);

  ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] std::span<const RawPositionPacket> positions() const noexcept override {
    return std::span(positions_).first(position_count_);
  }
  [[nodiscard]] const Senders* senders() const noexcept override { return &senders_; }
  [[nodiscard]] std::string_view error() const noexcept override { return error_; }
  [[nodiscard]] std::string_view warning() const noexcept override { return warning_; }

  [[nodiscard]] int port() const { return data_.port(); }
  [[nodiscard]] int position_port() const { return position_ ? position_->port() : 0; }
  [[nodiscard]] int fd() const { return data_.fd(); }
  [[nodiscard]] int receive_buffer_bytes() const { return data_.receive_buffer_bytes(); }

 private:
  UdpReceiver(DatagramSocket data, std::optional<DatagramSocket> position, const UdpReceiverOptions& options,
              LidarCounters& counters);
  bool receive_data() noexcept;
  bool receive_positions() noexcept;
  void fail_with_errno(int port, const char* call, int error) noexcept;

  DatagramSocket data_;
  std::optional<DatagramSocket> position_;
  LidarCounters& counters_;
  std::optional<std::uint32_t> source_ipv4_;
  Senders senders_;
  std::vector<RawPacket> packets_;
  std::vector<RawPositionPacket> positions_;
  std::size_t packet_count_ = 0, position_count_ = 0;
  std::array<char, 160> error_text_{};
  std::string_view error_;
  std::string warning_;
};

}  // namespace roadvec
