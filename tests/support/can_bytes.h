#pragma once

#include <vector>

#include "drivers/can/frame.h"

namespace roadvec {

/// What the frame carries, as numbers that a failing test prints.
inline std::vector<unsigned> bytes_of(const CanFrame& frame) {
  return {frame.data.begin(), frame.data.begin() + frame.length};
}

}  // namespace roadvec
