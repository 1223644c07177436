#pragma once

#include <cstdint>
#include <string_view>

#include "core/base/time.h"
#include "drivers/can/candump_line.h"

namespace roadvec {

/// The lines of a Vector ASC log, in their order: the header says how numbers and times are written. Frames classic,
/// CAN FD, remote and error, in hexadecimal or decimal; times absolute or relative to the line before. Other events are
/// passed over. Times are those of the header's date, which is the recording computer's local time without its zone; a
/// date in a language that is not known counts as 1970. Pure, no allocation.
class AscLines {
 public:
  /// A frame's interface is its channel, "1".
  [[nodiscard]] CandumpLine parse(std::string_view line) noexcept;
  /// True for a line that only the head of such a log has.
  [[nodiscard]] static bool is_header(std::string_view line) noexcept;

 private:
  [[nodiscard]] bool read_header(std::string_view line) noexcept;
  void read_date(std::string_view words) noexcept;
  [[nodiscard]] std::string_view read_classic(std::string_view words, CandumpLine& line) const noexcept;
  [[nodiscard]] std::string_view read_fd(std::string_view words, CandumpLine& line) const noexcept;
  [[nodiscard]] bool read_id(std::string_view word, CanFrame& frame) const noexcept;

  int base_ = 16;
  bool relative_ = false;
  std::int64_t date_ns_ = 0;
  std::int64_t last_ns_ = 0;  ///< of the line before, since the date
};

}  // namespace roadvec
