#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/time.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {

/// One position (telemetry) packet as it came in; only its length has been checked.
struct RawPositionPacket {
  SensorTime arrived;
  std::uint32_t source_ipv4 = 0;  ///< host byte order
  std::array<std::uint8_t, kPositionPacketBytes> bytes{};
};

/// The pulse per second of the GPS receiver at the sensor; unknown: old firmware leaves anything in that byte.
enum class PpsState : std::uint8_t { absent, synchronising, locked, error, unknown };
[[nodiscard]] const char* name_of(PpsState state) noexcept;

struct PositionPacket {
  std::uint32_t device_time_us = 0;  ///< past the hour
  PpsState pps = PpsState::unknown;
  std::string_view nmea;                ///< one or more sentences, without padding; views the packet
  std::optional<double> temperature_c;  ///< inside the sensor
  bool thermal_shutdown = false;        ///< new layout: it has stopped firing because it is too hot
};

/// Time, pulse and sentences lie at the same place in both layouts; what comes before is an inertial unit's readings
/// (HDL-32E) or, with firmware since 2018, temperatures. [VelodyneVLS128, p. 58] [VeloView]
[[nodiscard]] PositionPacket parse_position_packet(const RawPositionPacket& packet) noexcept;

}  // namespace roadvec
