#pragma once

#include <array>
#include <chrono>
#include <cstdint>

#include "core/ring/spsc_ring.h"
#include "daemon/stages/step_timer.h"

namespace roadvec {

/// The stations of a sweep on its way to the clients.
enum class Station : std::uint8_t {
  sweep,      ///< handed to the mapping thread
  mapped,     ///< steps 0 to 6 are done
  optimised,  ///< it became a keyframe, and steps 7 to 9 are done
  published,  ///< the changes that it made are frames in the log
  written,    ///< the first client that follows has them in its socket
};
inline constexpr std::array<const char*, 5> kStationNames = {"sweep", "mapped", "optimised", "published", "written"};

/// How long after the kernel received its last packet a sweep reached each station. One writer for each, the thread
/// that brings it there; any reader. No allocation, lock or system call but the clock's.
class Latencies {
 public:
  /// `received_ns`: Sweep::received_ns; 0, of recorded input, is left out.
  void note(Station station, std::int64_t received_ns) noexcept {
    if (received_ns == 0) return;
    const std::chrono::nanoseconds now = std::chrono::steady_clock::now().time_since_epoch();
    at_[static_cast<std::size_t>(station)].add(now - std::chrono::nanoseconds(received_ns));
  }
  [[nodiscard]] const DurationHistogram& at(Station station) const { return at_[static_cast<std::size_t>(station)]; }

 private:
  std::array<DurationHistogram, kStationNames.size()> at_;
};

/// Of which sweep a published change is.
struct ChangeStamp {
  std::uint64_t seq = 0;
  std::int64_t received_ns = 0;
};
/// Optimiser -> server. Full, because no client takes anything: the newest are left out of the figures.
using ChangeStamps = SpscRing<ChangeStamp, 4096>;

}  // namespace roadvec
