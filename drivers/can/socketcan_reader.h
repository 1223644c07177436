#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "drivers/can/can_reader.h"
#include "drivers/recording/backoff.h"

namespace roadvec {

/// Opens a raw CAN socket on `interface`: kernel filters that let `ids` through (no ids: every frame), CAN FD where the
/// kernel has it, error frames, kernel receive times, drop counts, a large buffer. The error names interface and
/// remedy.
[[nodiscard]] Expected<int> open_can_socket(const std::string& interface, std::span<const CanId> ids);

/// What the reader asks of the system; tests put their own in its place, since a test machine may have no CAN.
struct CanSystem {
  ssize_t (*receive)(int fd, msghdr* message, int flags) = ::recvmsg;
  Expected<int> (*open)(const std::string& interface, std::span<const CanId> ids) = open_can_socket;
};

/// Reads a CAN interface live. While the interface is down it waits. When it has been removed (USB adapters), it is
/// looked for by name, between 100 ms and 2 s apart; only that allocates. Time: the kernel's at reception.
class SocketCanReader : public CanReader {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<SocketCanReader>> open(const std::string& interface,
                                                                       std::span<const CanId> ids,
                                                                       const CanSystem& system = {});
  SocketCanReader(const SocketCanReader&) = delete;
  SocketCanReader& operator=(const SocketCanReader&) = delete;
  ~SocketCanReader() override;

  [[nodiscard]] CanReadResult read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] std::string_view interface_name(std::uint8_t interface) const noexcept override;
  [[nodiscard]] const CanCounters& counters() const noexcept override { return counters_; }

 private:
  SocketCanReader(const std::string& interface, std::span<const CanId> ids, const CanSystem& system, int fd);
  void use(int fd) noexcept;
  void wait_and_reopen(std::chrono::milliseconds timeout) noexcept;
  [[nodiscard]] CanReadResult receive(CanFrame& frame) noexcept;
  [[nodiscard]] CanReadResult on_error(int error) noexcept;
  void note_control_messages(msghdr& message, CanFrame& frame) noexcept;
  void close() noexcept;

  std::string interface_;
  std::vector<CanId> ids_;
  CanSystem system_;
  int fd_ = -1;
  std::uint32_t socket_drops_ = 0;  ///< the socket's own count, of which counters_ has already taken note
  Backoff backoff_;
  CanCounters counters_;
};

}  // namespace roadvec
