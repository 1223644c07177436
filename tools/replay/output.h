#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/time.h"
#include "drivers/can/frame.h"

namespace roadvec {

enum class SendResult : std::uint8_t { sent, lost };

/// When an item is sent.
struct SendMoment {
  SensorTime wall;        ///< date at which it is due, for items that carry a stamp
  bool may_wait = false;  ///< a full receiver is waited for (as fast as possible), else the item is lost
  const std::atomic<bool>* stop = nullptr;  ///< ends the waiting
};

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept { return std::swap(fd_, other.fd_), *this; }
  ~FileDescriptor();
  [[nodiscard]] int get() const { return fd_; }

 private:
  int fd_;
};

/// "HOST:PORT", "[IPv6]:PORT".
struct Endpoint {
  std::string host;
  int port = 0;
  [[nodiscard]] static Expected<Endpoint> parse(const std::string& text);
  [[nodiscard]] std::string text() const { return host + ":" + std::to_string(port); }
};

/// Datagrams to one address.
class UdpOutput {
 public:
  [[nodiscard]] static Expected<UdpOutput> open(const Endpoint& to);
  SendResult send(std::span<const std::uint8_t> datagram);

 private:
  explicit UdpOutput(int fd) : socket_(fd) {}
  FileDescriptor socket_;
};

/// Frames to a CAN interface.
class CanOutput {
 public:
  [[nodiscard]] static Expected<CanOutput> open(const std::string& interface);
  SendResult send(const CanFrame& frame, const SendMoment& moment);

 private:
  explicit CanOutput(int fd) : socket_(fd) {}
  FileDescriptor socket_;
};

/// A FIFO with a name; made if there is none, and then removed at the end. A piece of up to 4096 bytes is sent whole or
/// not at all.
class PipeOutput {
 public:
  [[nodiscard]] static Expected<PipeOutput> open(const std::string& path);
  PipeOutput(PipeOutput&&) noexcept = default;
  ~PipeOutput();
  [[nodiscard]] bool has_listener();
  SendResult send(std::span<const std::uint8_t> bytes, const SendMoment& moment);

 private:
  PipeOutput(std::string path, bool made) : path_(std::move(path)), made_(made) {}
  std::string path_;
  bool made_;
  FileDescriptor fifo_;  ///< can only be opened once there is a reader
};

/// The far end of a serial line: a pseudo-terminal in raw mode under a symbolic link, which is removed at the end.
class PtyOutput {
 public:
  [[nodiscard]] static Expected<PtyOutput> open(const std::string& path);
  PtyOutput(PtyOutput&&) noexcept = default;
  ~PtyOutput();
  [[nodiscard]] bool has_listener() const;
  SendResult send(std::span<const std::uint8_t> bytes, const SendMoment& moment);

 private:
  void wait_until_read() const;
  PtyOutput(std::string path, FileDescriptor terminal) : path_(std::move(path)), terminal_(std::move(terminal)) {}
  std::string path_;
  FileDescriptor terminal_;
};

}  // namespace roadvec
