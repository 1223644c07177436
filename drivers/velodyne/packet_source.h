#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/velodyne/packet.h"

namespace roadvec {

enum class ReadResult : std::uint8_t {
  packets,  ///< `batch` holds at least one
  quiet,    ///< nothing came before the timeout, or only what was counted and dropped
  end,      ///< end of the recording
  failed,   ///< nothing more will come; see error()
};

/// Where data packets come from: the sensor's socket or a recording.
class PacketSource {
 public:
  virtual ~PacketSource() = default;
  /// `batch` stays valid until the next read().
  virtual ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept = 0;
  /// Why read() failed: one line with the remedy. Empty otherwise.
  [[nodiscard]] virtual std::string_view error() const noexcept = 0;
};

inline constexpr std::size_t kBatchPackets = 64;  ///< 18 ms of an HDL-64E

}  // namespace roadvec
