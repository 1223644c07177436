#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/packet_source.h"

namespace roadvec {

struct UdpReceiverOptions {
  int port = kDataPort;  ///< 0: any free one, see UdpReceiver::port()
  /// Only packets of this sender are taken (host byte order); empty: any sender's.
  std::optional<std::uint32_t> source_ipv4{};
  /// 16 MB hold about 2.5 s of an HDL-64E: the kernel charges 2304 bytes for each packet (measured).
  int receive_buffer_bytes = 16 << 20;
  int adopted_fd = -1;  ///< a bound UDP socket to take over (systemd socket activation); then `port` is not used
};

/// Reads the sensor's UDP packets, up to kBatchPackets in one system call, with the kernel's receive stamps
/// (CLOCK_REALTIME, taken before any wake-up delay; they step when the host's clock is set). After open() nothing is
/// allocated.
class UdpReceiver final : public PacketSource {
 public:
  /// Fails when the port is taken or the socket cannot be set up. `counters` outlives the receiver.
  [[nodiscard]] static Expected<std::unique_ptr<UdpReceiver>> open(const UdpReceiverOptions& options,
                                                                   LidarCounters& counters);
  ~UdpReceiver() override;
  UdpReceiver(const UdpReceiver&) = delete;
  UdpReceiver& operator=(const UdpReceiver&) = delete;

  ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] std::string_view error() const noexcept override { return error_; }

  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] int fd() const { return fd_; }
  /// What the kernel granted, in the unit it was asked in; less than asked: net.core.rmem_max is in the way.
  [[nodiscard]] int receive_buffer_bytes() const { return receive_buffer_bytes_; }

 private:
  struct Slots;  ///< packets, control buffers and message headers of one batch
  UdpReceiver(int fd, const UdpReceiverOptions& options, LidarCounters& counters);
  [[nodiscard]] bool accept(std::size_t slot) noexcept;
  void fail_with_errno(const char* call) noexcept;

  int fd_;
  int port_ = 0;
  int receive_buffer_bytes_ = 0;
  std::optional<std::uint32_t> source_ipv4_;
  LidarCounters& counters_;
  std::uint32_t kernel_drop_total_ = 0;  ///< the kernel's own running count, which wraps
  std::unique_ptr<Slots> slots_;
  std::array<char, 160> error_text_{};
  std::string_view error_;
};

}  // namespace roadvec
