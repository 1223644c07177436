#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/time.h"
#include "core/sensor/motion.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/imu/vehicle_axes.h"

namespace roadvec {

inline constexpr std::size_t kNcomPacketBytes = 72;

/// What one NCOM packet says, in the axes of the outputs (x ahead, y right, z down) and in SI. [OxTSNCOM]
struct NcomSample {
  std::uint16_t time_ms = 0;            ///< into the minute of GPS time
  std::optional<std::int32_t> minutes;  ///< since 1980-01-06; in packets of status channel 0 alone
  std::uint8_t navigation_status = 0;   ///< 4: locked
  std::optional<Eigen::Vector3d> acceleration_mps2, rate_radps;
  std::optional<Eigen::Vector3d> heading_pitch_roll_rad;  ///< clockwise from north; nose up; right side down
};

struct NcomCounters {
  std::uint64_t packet_count = 0;
  std::uint64_t bad_checksum_count = 0;
  std::uint64_t skipped_byte_count = 0;  ///< outside packets: noise, or what a bad packet was made of
  std::uint64_t trigger_count = 0;       ///< trigger and status-only packets: no motion in them
  std::uint64_t not_ready_count = 0;     ///< packets of a unit that does not navigate yet and told nothing
};

/// One packet that begins with its sync byte and has the right checksum.
[[nodiscard]] NcomSample parse_ncom(std::span<const std::uint8_t, kNcomPacketBytes> packet) noexcept;

/// UTC for a time of GPS; both count seconds, GPS without leap ones, of which the last came on 2017-01-01.
[[nodiscard]] SensorTime utc_from_gps_ns(std::int64_t since_1980_ns) noexcept;

/// Full time from packets that mostly tell the milliseconds of their minute alone. A minute that turns over, also with
/// packets out of order around it, is the nearest to the packet before.
class NcomClock {
 public:
  /// UTC; nothing until a packet has told the minute.
  [[nodiscard]] std::optional<SensorTime> time_of(const NcomSample& sample) noexcept;

 private:
  std::optional<std::int64_t> last_ms_;  ///< since 1980-01-06
};

/// From the bytes of an ImuReader to motion samples. Time: that of the piece of bytes that completes the packet, or the
/// device's, as UTC, where the reader knows none. Mounting: of the outputs' axes turned to x ahead, y left, z up; a
/// unit that is set up for its car gives the vehicle's own, and all angles are 0. No allocation.
class NcomDecoder {
 public:
  explicit NcomDecoder(const Mounting& mounting) : to_vehicle_(mounting) {}

  /// Takes bytes off the front of `bytes` up to the next sample; false when they are used up. Call until then.
  [[nodiscard]] bool next(ImuBytes& bytes, MotionSample& sample) noexcept;

  [[nodiscard]] const NcomCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] const NcomSample& last() const noexcept { return last_; }                ///< what the device said last
  [[nodiscard]] std::uint64_t untimed_count() const noexcept { return untimed_count_; }  ///< without any time; dropped

 private:
  [[nodiscard]] bool next_packet(std::span<const std::uint8_t>& bytes) noexcept;

  std::array<std::uint8_t, kNcomPacketBytes> buffer_{};
  std::size_t count_ = 0;  ///< bytes of the packet that are there
  SensorToVehicle to_vehicle_;
  NcomClock clock_;
  NcomSample last_;
  NcomCounters counters_;
  std::uint64_t untimed_count_ = 0;
};

}  // namespace roadvec
