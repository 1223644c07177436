#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "drivers/can/frame.h"

namespace roadvec {

enum class CanReadResult : std::uint8_t {
  frame,   ///< `frame` was written
  quiet,   ///< nothing within the timeout, or something that was counted instead
  end,     ///< the recording is over
  failed,  ///< reading failed for a reason that waiting does not mend
};

/// Whether an interface gives frames.
enum class CanState : std::uint8_t {
  working,
  bus_off,  ///< the controller has left the bus after too many errors, until it is restarted
  down,
  lost,  ///< removed; looked for by name
};

/// Everything that kept a frame from us, each under a name a user understands.
struct CanCounters {
  std::uint64_t frame_count = 0;  ///< handed over, error and remote frames too

  std::uint64_t error_frame_count = 0;  ///< of these: told by the controller about the bus, one or more classes each
  std::uint64_t bus_off_count = 0;
  std::uint64_t restarted_count = 0;
  std::uint64_t passive_count = 0;  ///< times that the controller told of many errors: warning or passive state
  std::uint64_t controller_problem_count = 0;   ///< of its own, those of the line above too
  std::uint64_t controller_overflow_count = 0;  ///< of these: the controller lost a frame before the kernel had it
  std::uint64_t bus_error_count = 0;            ///< lost arbitration, protocol violation, no acknowledge, bus error
  std::uint64_t other_error_count = 0;          ///< transceiver, transmit time-out, error counters

  std::uint64_t kernel_drop_count = 0;        ///< live: the socket's buffer was full; log: what candump said it lost
  std::uint64_t wrong_size_count = 0;         ///< datagrams that are no CAN or CAN FD frame
  std::uint64_t interface_down_count = 0;     ///< times the interface went down
  std::uint64_t interface_lost_count = 0;     ///< times it was removed
  std::uint64_t reopened_count = 0;           ///< times it came back
  std::uint64_t foreign_interface_count = 0;  ///< log: frames of an interface that was not asked for
  std::uint64_t bad_line_count = 0;           ///< log: lines that hold no frame
  std::uint64_t first_bad_line = 0;           ///< its number from 1; 0: none yet

  CanState state = CanState::working;
  std::uint64_t receive_buffer_bytes = 0;  ///< live: what the kernel grants
};

/// A source of frames: a bus, or a recording of one.
class CanReader {
 public:
  virtual ~CanReader() = default;

  /// The next frame, after `timeout` at most. A recording never waits.
  [[nodiscard]] virtual CanReadResult read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept = 0;

  /// What CanFrame::interface stands for; "" for a number that was never handed out.
  [[nodiscard]] virtual std::string_view interface_name(std::uint8_t interface) const noexcept = 0;

  [[nodiscard]] virtual const CanCounters& counters() const noexcept = 0;

  /// Why the first bad line of a log was bad; "" while there was none.
  [[nodiscard]] virtual std::string_view first_bad_line_reason() const noexcept { return {}; }
};

/// Counts the classes of an error frame, as linux/can/error.h defines them.
void count_error_frame(const CanFrame& frame, CanCounters& counters) noexcept;

}  // namespace roadvec
