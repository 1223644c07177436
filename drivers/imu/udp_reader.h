#pragma once

#include <memory>

#include "core/base/error.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/udp/datagram_socket.h"

namespace roadvec {

/// Reads a device that sends its bytes as UDP datagrams; each comes as one piece, with the kernel's receive stamp.
class ImuUdpReader final : public ImuReader {
 public:
  /// `port` 0: any free one. `adopted_fd` >= 0: a bound socket to take over (systemd socket activation).
  [[nodiscard]] static Expected<std::unique_ptr<ImuUdpReader>> open(int port, int adopted_fd = -1);

  [[nodiscard]] ImuReadResult read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] const ImuCounters& counters() const noexcept override { return counters_; }
  [[nodiscard]] int port() const { return socket_.port(); }

 private:
  explicit ImuUdpReader(DatagramSocket socket) : socket_(std::move(socket)) {}

  DatagramSocket socket_;
  std::span<const Datagram> waiting_;  ///< received and not handed out
  ImuCounters counters_;
};

}  // namespace roadvec
