#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/time.h"

namespace roadvec {

enum class ReturnKind : std::uint8_t {
  single = 0,     ///< the sensor sends one return a firing, whichever it is set to
  strongest = 1,  ///< dual mode: the brighter one
  last = 2,       ///< dual mode: the farther one
  both = 3,       ///< dual mode: strongest and last were the same echo; sent once
};

/// One echo, calibrated, in the `lidar` frame (x ahead, y left, z up).
struct Return {
  float x_m = 0, y_m = 0, z_m = 0;
  float azimuth_rad = 0;      ///< of the beam, clockwise from straight ahead as the sensor counts it, [0, 2 pi)
  std::uint32_t time_ns = 0;  ///< after Sweep::start
  std::uint8_t laser = 0;     ///< number in the packet's order, 0..127 (HDL-64E: 0..31 upper bank, 32..63 lower)
  std::uint8_t intensity = 0;
  ReturnKind kind = ReturnKind::single;
  std::uint8_t reserved = 0;
};
static_assert(sizeof(Return) == 24);

/// One revolution, in firing order. `returns` is reserved once by its owner and never grows while driving.
struct Sweep {
  SensorTime start;         ///< of the first firing
  SensorTime end;           ///< of the last firing
  std::uint64_t index = 0;  ///< counts revolutions since start-up
  bool complete = false;    ///< false: begins or ends inside a revolution, or packets are missing
  /// When the kernel received its last packet, by the receiver's steady clock, for figures of latency; 0: recorded.
  std::int64_t received_ns = 0;
  std::vector<Return> returns;
};

}  // namespace roadvec
