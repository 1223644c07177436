#pragma once

#include <cstdint>
#include <string_view>

#include "drivers/can/frame.h"

namespace roadvec {

enum class CandumpKind : std::uint8_t {
  frame,
  drops,  ///< "DROPCOUNT: dropped 3 CAN frames ...": candump itself was too slow
  blank,
  bad,
};

struct CandumpLine {
  CandumpKind kind = CandumpKind::bad;
  CanFrame frame;
  std::string_view interface;  ///< points into the line
  bool has_time = false;       ///< candump without -t prints frames to the console without a time
  std::uint64_t dropped_count = 0;
  std::string_view reason;  ///< of a bad line
};

/// One line as candump writes it, to a file (-l, -L: "(1.000000) can0 123#1122") or to the console ("can0  123   [2]
/// 11 22"), with or without time and direction; data, remote, CAN FD and error frames. Pure, no allocation.
[[nodiscard]] CandumpLine parse_candump_line(std::string_view line) noexcept;

}  // namespace roadvec
