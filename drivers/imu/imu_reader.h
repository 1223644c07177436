#pragma once

#include <chrono>
#include <cstdint>
#include <span>

#include "core/base/time.h"

namespace roadvec {

enum class ImuReadResult : std::uint8_t {
  bytes,   ///< `bytes` was written
  quiet,   ///< nothing within the timeout, or something that was counted instead
  end,     ///< the recording is over
  failed,  ///< reading failed for a reason that waiting does not mend
};

/// A piece of what a device sent, in its own protocol; messages begin and end anywhere in it.
struct ImuBytes {
  SensorTime time;        ///< when its last byte arrived
  bool has_time = false;  ///< false: a recording without times; the decoder takes the device's clock
  std::span<const std::uint8_t> bytes;
};

struct ImuCounters {
  std::uint64_t byte_count = 0;
  std::uint64_t device_lost_count = 0;  ///< times the device vanished
  std::uint64_t reopened_count = 0;     ///< times it came back
  std::uint64_t kernel_drop_count = 0;  ///< UDP: datagrams lost because the socket's buffer was full
  std::uint64_t bad_line_count = 0;     ///< log: lines that hold no time and bytes
  std::uint64_t first_bad_line = 0;     ///< its number from 1; 0: none yet
};

/// A source of an IMU's bytes: a device, or a recording of one. A decoder for the device's protocol makes samples of
/// them (xsens.h), so each protocol works over each way in.
class ImuReader {
 public:
  virtual ~ImuReader() = default;

  /// The next bytes, after `timeout` at most; valid until the next call. A recording never waits.
  [[nodiscard]] virtual ImuReadResult read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept = 0;

  [[nodiscard]] virtual const ImuCounters& counters() const noexcept = 0;
};

}  // namespace roadvec
