#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/base/time.h"

namespace roadvec {

// The data packet of every Velodyne head: 12 blocks of 100 bytes and a tail of 6, little endian. [VelodyneVLP16, p. 54]
inline constexpr std::size_t kPacketBytes = 1206;
inline constexpr std::size_t kBlockBytes = 100;
inline constexpr int kBlocksPerPacket = 12;
inline constexpr std::size_t kBlockFlagOffset = 0, kBlockAzimuthOffset = 2, kBlockEchoesOffset = 4;
inline constexpr std::size_t kEchoBytes = 3;  ///< distance, 2 bytes; intensity, 1 byte
inline constexpr std::size_t kDeviceTimeOffset = 1200, kReturnModeOffset = 1204, kProductIdOffset = 1205;
inline constexpr std::array<std::uint16_t, 4> kBankFlags{0xEEFF, 0xDDFF, 0xCCFF,
                                                         0xBBFF};  ///< lasers 0.., 32.., 64.., 96..
inline constexpr std::array<std::uint16_t, 2> kEmptyBlockFlags{0x0000,
                                                               0xFFFF};  ///< of blocks that a packet does not need
inline constexpr std::uint8_t kDualReturnMode = 0x39;
inline constexpr std::uint8_t kTripleReturnMode = 0x3A, kConfidenceReturnMode = 0x3B;  ///< VLS-128 alone [VeloView]
inline constexpr std::uint8_t kStrongestReturnMode = 0x37, kLastReturnMode = 0x38;
/// Readings of a running head are up to 1.6 degrees apart (VLP-16, 40 turns a second), and shake by less. One farther
/// ahead is behind a sector that the head does not send.
inline constexpr int kLargestStep_cdeg = 300;
inline constexpr std::uint16_t kFullCircle_cdeg = 36000;  ///< azimuth words are hundredths of a degree, clockwise
inline constexpr std::int64_t kHour_ns = 3'600'000'000'000;

inline constexpr int kDataPort = 2368, kPositionPort = 8308;
inline constexpr std::size_t kPositionPacketBytes = 512;

using PacketBytes = std::array<std::uint8_t, kPacketBytes>;

/// One data packet as it came in; only its length has been checked.
struct RawPacket {
  SensorTime arrived;             ///< kernel or capture stamp, when its last firing was over
  std::uint32_t source_ipv4 = 0;  ///< host byte order
  PacketBytes bytes{};
};

[[nodiscard]] inline std::uint16_t u16_at(const PacketBytes& bytes, std::size_t at) noexcept {
  return static_cast<std::uint16_t>(bytes[at] | bytes[at + 1] << 8);
}
[[nodiscard]] inline std::uint16_t block_flag(const PacketBytes& bytes, int block) noexcept {
  return u16_at(bytes, static_cast<std::size_t>(block) * kBlockBytes + kBlockFlagOffset);
}
[[nodiscard]] inline std::uint16_t block_azimuth_cdeg(const PacketBytes& bytes, int block) noexcept {
  return u16_at(bytes, static_cast<std::size_t>(block) * kBlockBytes + kBlockAzimuthOffset);
}
/// Microseconds past the hour by the sensor's own clock.
[[nodiscard]] inline std::uint32_t device_time_us(const PacketBytes& bytes) noexcept {
  return u16_at(bytes, kDeviceTimeOffset) | static_cast<std::uint32_t>(u16_at(bytes, kDeviceTimeOffset + 2)) << 16;
}
/// Times past the hour differ by this: into [-half an hour, half an hour).
[[nodiscard]] inline std::int64_t wrap_hour_ns(std::int64_t ns) noexcept {
  const std::int64_t forward_ns = ((ns % kHour_ns) + kHour_ns) % kHour_ns;
  return forward_ns < kHour_ns / 2 ? forward_ns : forward_ns - kHour_ns;
}
/// The way round the circle from a to b, in [-18000, 18000).
[[nodiscard]] inline int azimuth_step_cdeg(int a_cdeg, int b_cdeg) noexcept {
  const int forward = (b_cdeg - a_cdeg + kFullCircle_cdeg) % kFullCircle_cdeg;
  return forward < kFullCircle_cdeg / 2 ? forward : forward - kFullCircle_cdeg;
}

}  // namespace roadvec
