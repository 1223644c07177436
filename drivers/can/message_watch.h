#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/base/time.h"
#include "drivers/can/checksum.h"
#include "drivers/can/dbc.h"
#include "drivers/can/signals.h"

namespace roadvec {

/// What a message tells of itself. Signals are of this message, without its name; "": it has none.
struct MessageCheck {
  std::string message;
  std::string counter;   ///< counts its frames, from 0 to the most its bits hold
  std::string checksum;  ///< where the sum of kind `kind` lies
  ChecksumKind kind = ChecksumKind::none;
  double timeout_s = 0.0;  ///< silence that counts; 0: five of the file's cycle times
};

struct MessageCounters {
  std::uint64_t bad_checksum_count = 0;  ///< frames that were dropped for it
  std::uint64_t counter_gap_count = 0;   ///< frames whose counter did not follow that of the frame before
  std::uint64_t timeout_count = 0;       ///< times that a message fell silent
};

/// Watches the frames of one message. No allocation, no exceptions once made.
class MessageWatch {
 public:
  explicit MessageWatch(const DbcMessage& message);
  /// The error names the signal.
  [[nodiscard]] Expected<void> add(const DbcFile& dbc, const MessageCheck& check);

  [[nodiscard]] CanId id() const noexcept { return id_; }
  /// A frame of this message; false: its checksum is wrong and it must not be used.
  [[nodiscard]] bool accept(const CanFrame& frame, MessageCounters& counters) noexcept;
  /// True once, when the message has been silent for too long at `now`, the time of any frame.
  [[nodiscard]] bool falls_silent(SensorTime now, MessageCounters& counters) noexcept;

 private:
  CanId id_;
  std::optional<SignalDecoder> counter_, checksum_;
  ChecksumKind kind_ = ChecksumKind::none;
  std::int64_t timeout_ns_ = 0;  ///< 0: never
  std::optional<std::uint64_t> last_count_;
  std::optional<SensorTime> last_;  ///< nothing: not yet, or already told as silent
};

}  // namespace roadvec
