#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/time.h"
#include "tools/import/head_fit.h"

namespace roadvec {

/// All lasers at one reading of the encoder.
struct Firing {
  SensorTime time;
  int cell = 0;
  std::array<std::uint16_t, kHeadLasers> raw{};  ///< in steps of 2 mm; 0: no echo
  std::array<std::uint8_t, kHeadLasers> intensity{};
  std::array<KittiPoint, kHeadLasers> points{};  ///< what the echoes were made from
};

struct Firings {
  std::vector<Firing> firings;  ///< by time
  std::size_t lost_count = 0;   ///< points that no echo stands for: a second one of the same laser at the same reading
  std::size_t off_count = 0;    ///< points farther than 3 mm from their laser's cone
};

/// Turns one revolution back into what the sensor measured. KITTI cuts its revolutions where the head looks back; the
/// head turns clockwise and reads its encoder at even intervals between `start` and `end`. Readings that no laser has
/// an echo of are put in where the step is too long.
[[nodiscard]] Firings find_firings(const LaserPoints& points, const HeadFit& head, SensorTime start, SensorTime end);

/// From one firing of a head to the next.
inline constexpr std::int64_t kFiringPeriod_ns = 48'000;

}  // namespace roadvec
