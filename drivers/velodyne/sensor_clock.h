#pragma once

#include <cstdint>
#include <optional>

#include "drivers/velodyne/nmea.h"
#include "drivers/velodyne/position_packet.h"

namespace roadvec {

/// What is known of the sensor's clock and of the GPS receiver that sets it.
struct SensorClockReport {
  std::uint64_t position_packet_count = 0;
  std::uint64_t nmea_count = 0;      ///< RMC and GGA sentences read, repetitions too
  std::uint64_t nmea_bad_count = 0;  ///< with a wrong checksum, or not as NMEA has it
  PpsState pps = PpsState::unknown;  ///< as last told
  std::optional<double> temperature_c;
  bool thermal_shutdown = false;
  std::optional<NmeaFix> fix;  ///< the last RMC or GGA
  SensorTime fix_arrived;      ///< when it came first: a receiver's sentence is repeated until the next one
  std::optional<std::int64_t> device_after_nmea_ns;  ///< the sensor's stamp then, past the sentence's own time
  std::optional<std::int64_t> host_after_nmea_ns;    ///< likewise the host's clock; RMC alone
};

/// Keeps the report up to date, packet by packet. Pure; no allocation.
class SensorClock {
 public:
  /// Null, or the sentence's content when the packet brings one that was not there before. Valid until the next call.
  const NmeaFix* add(const RawPositionPacket& packet) noexcept;
  [[nodiscard]] const SensorClockReport& report() const { return report_; }

 private:
  bool take(const NmeaFix& fix, SensorTime arrived, std::uint32_t device_time_us) noexcept;
  SensorClockReport report_;
};

/// A receiver's sentence comes up to this much after the second it tells of, so a sensor whose stamp is that far past
/// it keeps UTC. [VeloView] assumes 94 ms; 1.2 s was measured on an HDL-32E with a receiver of one sentence a second.
inline constexpr std::int64_t kLatestNmea_ns = 2'500'000'000;

/// The sensor's stamps are UTC: the receiver has a fix and its time agrees with them. Nothing: not known.
[[nodiscard]] std::optional<bool> keeps_utc(const SensorClockReport& report) noexcept;

}  // namespace roadvec
