#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/base/error.h"
#include "core/base/time.h"

namespace roadvec {

/// A datagram with the kernel's receive stamp (CLOCK_REALTIME, taken before any wake-up delay; it steps when the host's
/// clock is set).
struct Datagram {
  SensorTime arrived;
  std::uint32_t source_ipv4 = 0;        ///< host byte order
  std::size_t length = 0;               ///< as sent; more than bytes.size(): what was longer than expected was let go
  std::span<const std::uint8_t> bytes;  ///< valid until the next receive()
};

struct DatagramSocketOptions {
  int port = 0;  ///< 0: any free one
  int receive_buffer_bytes = 1 << 20;
  /// A bound UDP socket to take over (systemd socket activation); then `port` is not used, and what lies in it is not.
  int adopted_fd = -1;
  std::size_t most_bytes = 1500;  ///< of a datagram
  std::size_t batch = 16;         ///< datagrams of one system call
};

/// A bound UDP socket, read in batches. After open() nothing is allocated.
class DatagramSocket {
 public:
  /// Fails when the port is taken or the socket cannot be set up.
  [[nodiscard]] static Expected<DatagramSocket> open(const DatagramSocketOptions& options);
  DatagramSocket(DatagramSocket&&) noexcept;
  DatagramSocket& operator=(DatagramSocket&&) = delete;
  ~DatagramSocket();

  /// What is there, without waiting; empty: nothing, or (errno of the call) failure.
  [[nodiscard]] std::span<const Datagram> receive(int& error) noexcept;

  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] int port() const { return port_; }
  /// What the kernel granted, in the unit it was asked in; less than asked: net.core.rmem_max is in the way.
  [[nodiscard]] int receive_buffer_bytes() const { return receive_buffer_bytes_; }
  /// Datagrams that lay in an adopted socket: they came before we did.
  [[nodiscard]] std::uint64_t before_start_count() const { return before_start_count_; }
  /// Datagrams the kernel threw away because the buffer was full, since the last call. It tells with the first one
  /// that it queues after them.
  [[nodiscard]] std::uint32_t take_drops() noexcept;

 private:
  struct Slots;
  DatagramSocket(int fd, const DatagramSocketOptions& options);
  void read_controls(std::size_t slot) noexcept;
  void forget_the_past() noexcept;

  int fd_, port_, receive_buffer_bytes_;
  std::uint32_t drop_total_ = 0, drops_taken_ = 0;  ///< the kernel's own running count, which wraps
  std::uint64_t before_start_count_ = 0;
  std::unique_ptr<Slots> slots_;
};

}  // namespace roadvec
