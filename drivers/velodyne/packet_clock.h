#pragma once

#include <cstdint>
#include <optional>

#include "core/base/time.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {

/// Whose clock stamps the firings.
enum class PacketTimeBase : std::uint8_t {
  arrival,  ///< the host's: a packet arrives when its last firing is over
  device,   ///< intervals from the sensor, which no scheduler disturbs; its offset follows the earliest arrivals on the
            ///< host's clock
  device_utc,  ///< the sensor is set by GPS: its stamp is the time past a UTC hour, and the arrival says which hour
};
/// What the stamp of an HDL-64E packet means is disputed [velodyne_decoder] [VeloView]; it matters for device_utc
/// alone.
enum class PacketStampMeaning : std::uint8_t { first_firing, last_firing };

struct PacketClockOptions {
  PacketTimeBase base = PacketTimeBase::arrival;
  PacketStampMeaning stamp = PacketStampMeaning::first_firing;
};

struct PacketTiming {
  SensorTime first_firing;
  std::uint32_t lost_before_count = 0;  ///< packets missing between the one before and this one
  bool stale = false;                   ///< out of order or a duplicate: its firings lie before those already seen
  /// Not of the revolution before: the sensor paused or most of a turn was lost by its own clock, or a clock was set.
  /// Packets that only arrive late, after a host or a player that stalled, belong where they are.
  bool apart = false;
};

/// How the sensor's clock stands to the host's, for people.
struct PacketClockState {
  struct ClockStep {
    std::int64_t size_ns = 0;  ///< what the sensor's clock went on more than the host's
    SensorTime time;
  };
  std::int64_t device_minus_host_ns = 0;  ///< stamp minus first firing by its arrival, modulo an hour
  std::optional<ClockStep> last_step;
};

/// Turns packets' stamps into the times of their first firings, and sees by the sensor's clock what is missing or out
/// of order: data packets carry no number. The sensor counts microseconds past the hour and may run past 3600 s before
/// it starts again, so a step is taken modulo an hour into +-30 minutes. Pure; no allocation.
class PacketClock {
 public:
  PacketClock(const PacketClockOptions& options, LidarCounters& counters) : options_(options), counters_(counters) {}

  /// `duration_ns`: all firings of the packet; `azimuth_cdeg`: of its first usable reading.
  [[nodiscard]] PacketTiming place(const RawPacket& packet, std::uint32_t duration_ns,
                                   std::uint16_t azimuth_cdeg) noexcept;
  [[nodiscard]] const PacketClockState& state() const { return state_; }

 private:
  enum class Step : std::uint8_t { first, forward, stale, clock_step };
  [[nodiscard]] Step classify(std::int64_t device_step_ns, std::int64_t host_step_ns,
                              std::uint16_t azimuth_cdeg) const noexcept;
  [[nodiscard]] SensorTime first_firing(const RawPacket& packet, std::uint32_t duration_ns, Step step,
                                        std::int64_t device_step_ns) noexcept;

  PacketClockOptions options_;
  LidarCounters& counters_;
  PacketClockState state_;
  bool started_ = false;
  SensorTime last_arrived_;
  SensorTime last_end_;                 ///< of the last packet's last firing
  std::int64_t last_device_ns_ = 0;     ///< past the hour
  std::uint32_t last_duration_ns_ = 0;  ///< longer than others where a limited field of view leaves part of a turn out
  std::uint16_t last_azimuth_cdeg_ = 0;
  std::int64_t unwrapped_ns_ = 0;  ///< the sensor's clock without its hours, from 0 at the first packet
  std::int64_t offset_ns_ = 0;     ///< first firing on the host's clock minus unwrapped_ns_
};

}  // namespace roadvec
