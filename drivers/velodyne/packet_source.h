#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/velodyne/packet.h"
#include "drivers/velodyne/position_packet.h"
#include "drivers/velodyne/senders.h"

namespace roadvec {

enum class ReadResult : std::uint8_t {
  packets,  ///< `batch` or positions() holds at least one
  quiet,    ///< nothing came before the timeout, or only what was counted and dropped
  end,      ///< end of the recording
  failed,   ///< nothing more will come; see error()
};

/// Where the sensor's packets come from: its sockets or a recording.
class PacketSource {
 public:
  virtual ~PacketSource() = default;
  /// `batch`: data packets. Stays valid until the next read().
  virtual ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept = 0;
  /// Position packets that came with the last batch.
  [[nodiscard]] virtual std::span<const RawPositionPacket> positions() const noexcept { return {}; }
  /// Who sends to the port; null: not known.
  [[nodiscard]] virtual const Senders* senders() const noexcept { return nullptr; }
  /// Why read() failed: one line with the remedy. Empty otherwise.
  [[nodiscard]] virtual std::string_view error() const noexcept = 0;
  /// What a person should know although reading goes on, or has come to its end: one line. Empty: nothing.
  [[nodiscard]] virtual std::string_view warning() const noexcept { return {}; }
};

inline constexpr std::size_t kBatchPackets = 64;    ///< 18 ms of an HDL-64E
inline constexpr std::size_t kBatchPositions = 16;  ///< a sensor sends at least 9 data packets to each

}  // namespace roadvec
