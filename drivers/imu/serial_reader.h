#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/recording/backoff.h"

namespace roadvec {

/// Reads a device on a serial line or USB: raw bytes, eight data bits, no parity, no flow control. Nothing is ever
/// written to it: it must be set to measure, with its outputs configured (see xsens_setup.h). A device that vanishes is
/// looked for under the same path, between 100 ms and 2 s apart; only that allocates. Time: when the bytes were
/// fetched, which the line's speed puts behind the measurement (a message of 70 bytes takes 6 ms at 115200 baud).
class SerialReader : public ImuReader {
 public:
  /// The error names the path and what to do about it.
  [[nodiscard]] static Expected<std::unique_ptr<SerialReader>> open(const std::string& path, unsigned baud);

  SerialReader(const SerialReader&) = delete;
  SerialReader& operator=(const SerialReader&) = delete;
  ~SerialReader() override;

  [[nodiscard]] ImuReadResult read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] const ImuCounters& counters() const noexcept override { return counters_; }

 private:
  static constexpr std::size_t kBufferBytes = 4096;

  SerialReader(const std::string& path, unsigned baud, int fd) : path_(path), baud_(baud), fd_(fd) {}
  void wait_and_reopen(std::chrono::milliseconds timeout) noexcept;
  void lose_device() noexcept;

  std::string path_;
  unsigned baud_;
  int fd_;
  std::array<std::uint8_t, kBufferBytes> buffer_{};
  Backoff backoff_;
  ImuCounters counters_;
};

}  // namespace roadvec
