#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "drivers/can/can_reader.h"
#include "drivers/recording/capture_file.h"

namespace roadvec {

/// Reads what tcpdump or Wireshark recorded on a CAN interface (link layer CAN_SOCKETCAN): pcap or pcapng, plain, gzip
/// or zstd. A file that ends inside its last record ends there.
class CanCaptureReader final : public CanReader {
 public:
  /// `offset_ns` is added to every time. Fails where the file is no capture, or not of a CAN interface.
  [[nodiscard]] static Expected<std::unique_ptr<CanCaptureReader>> open(const std::string& path,
                                                                        std::int64_t offset_ns = 0);

  [[nodiscard]] CanReadResult read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept override;
  /// A capture does not say.
  [[nodiscard]] std::string_view interface_name(std::uint8_t) const noexcept override { return {}; }
  [[nodiscard]] const CanCounters& counters() const noexcept override { return counters_; }

 private:
  CanCaptureReader(CaptureFile file, std::int64_t offset_ns) : file_(std::move(file)), offset_ns_(offset_ns) {}

  CaptureFile file_;
  std::int64_t offset_ns_;
  CanCounters counters_;
};

/// A log of any kind that is read: candump, Vector ASC, or a capture; its first bytes say which.
[[nodiscard]] Expected<std::unique_ptr<CanReader>> open_can_log(const std::string& path, std::int64_t offset_ns = 0);

}  // namespace roadvec
