#include "drivers/velodyne/position_packet.h"

#include <algorithm>

namespace roadvec {
namespace {

using Bytes = std::array<std::uint8_t, kPositionPacketBytes>;
constexpr std::size_t kTopBoardOffset = 0xBB, kCalibrationReasonOffset = 0xC4;
constexpr std::size_t kTimeOffset = 0xC6, kPpsOffset = 0xCA, kThermalOffset = 0xCB, kNmeaOffset = 0xCE;

unsigned u16_at(const Bytes& bytes, std::size_t at) { return bytes[at] | static_cast<unsigned>(bytes[at + 1]) << 8; }

/// Three groups of rate, temperature and two accelerations, each word with its kind in the high four bits.
bool is_inertial(const Bytes& bytes) {
  for (const std::size_t group : {14U, 22U, 30U}) {
    for (unsigned kind = 0; kind < 4; ++kind) {
      if (u16_at(bytes, group + 2 * kind) >> 12 != kind) return false;
    }
  }
  return true;
}

double inertial_temperature_c(const Bytes& bytes) {
  constexpr double kDegreesPerStep = 0.1453;
  const int low = static_cast<int>(u16_at(bytes, 16) & 0x0FFF);
  return 25 + kDegreesPerStep * (low < 0x800 ? low : low - 0x1000);
}

}  // namespace

const char* name_of(PpsState state) noexcept {
  constexpr std::array<const char*, 5> kNames{"absent", "synchronising", "locked", "error", "unknown"};
  return kNames[static_cast<std::size_t>(state)];
}

PositionPacket parse_position_packet(const RawPositionPacket& raw) noexcept {
  const Bytes& bytes = raw.bytes;
  PositionPacket packet;
  packet.device_time_us = u16_at(bytes, kTimeOffset) | u16_at(bytes, kTimeOffset + 2) << 16;
  if (bytes[kPpsOffset] < 4) packet.pps = static_cast<PpsState>(bytes[kPpsOffset]);
  const auto text = std::find(bytes.begin() + kNmeaOffset, bytes.end(), std::uint8_t{0});
  packet.nmea = {reinterpret_cast<const char*>(bytes.data()) + kNmeaOffset,
                 static_cast<std::size_t>(text - bytes.begin()) - kNmeaOffset};
  // Old firmware without an inertial unit leaves junk in the place of the temperatures; three fields tell it.
  const bool has_temperatures = packet.pps != PpsState::unknown && bytes[kCalibrationReasonOffset] <= 4 &&
                                bytes[kThermalOffset] <= 1 && bytes[kTopBoardOffset] != 0;
  if (is_inertial(bytes)) {
    packet.temperature_c = inertial_temperature_c(bytes);
  } else if (has_temperatures) {
    packet.temperature_c = static_cast<std::int8_t>(bytes[kTopBoardOffset]);
    packet.thermal_shutdown = bytes[kThermalOffset] == 1;
  }
  return packet;
}

}  // namespace roadvec
