#include "drivers/can/checksum.h"

#include <span>

namespace roadvec {
namespace {

using Bytes = std::span<const std::uint8_t>;

std::uint64_t sum_of_bytes(const CanFrame& frame, Bytes data) {
  std::uint64_t sum = 0;
  for (std::uint32_t id = frame.id; id != 0; id >>= 8) sum += id & 0xFF;
  for (const std::uint8_t byte : data) sum += byte;
  return sum;
}

std::uint64_t honda_sum(const CanFrame& frame, Bytes data) {
  std::uint64_t sum = 0;
  for (std::uint32_t id = frame.id; id != 0; id >>= 4) sum += id & 0xF;
  for (const std::uint8_t byte : data) sum += static_cast<std::uint64_t>(byte & 0xF) + (byte >> 4);
  return (8 + (frame.extended ? 3U : 0U) - sum) & 0xF;
}

std::uint16_t crc16(std::uint16_t crc, std::uint8_t byte) {
  crc = static_cast<std::uint16_t>(crc ^ byte << 8);
  for (int bit = 0; bit < 8; ++bit)
    crc = static_cast<std::uint16_t>((crc & 0x8000) != 0 ? crc << 1 ^ 0x1021 : crc << 1);
  return crc;
}

std::optional<std::uint64_t> hyundai_crc(const CanFrame& frame, Bytes data) {
  std::uint16_t length_constant = 0;
  switch (data.size()) {
    case 8:
      length_constant = 0x5F29;
      break;
    case 16:
      length_constant = 0x041D;
      break;
    case 24:
      length_constant = 0x819D;
      break;
    case 32:
      length_constant = 0x9F5B;
      break;
    default:
      return std::nullopt;
  }
  std::uint16_t crc = 0;
  for (const std::uint8_t byte : data.subspan(2)) crc = crc16(crc, byte);
  crc = crc16(crc, static_cast<std::uint8_t>(frame.id & 0xFF));
  crc = crc16(crc, static_cast<std::uint8_t>(frame.id >> 8 & 0xFF));
  return crc ^ length_constant;
}

std::uint8_t crc8(std::uint8_t crc, std::uint8_t byte) {
  crc = static_cast<std::uint8_t>(crc ^ byte);
  for (int bit = 0; bit < 8; ++bit) crc = static_cast<std::uint8_t>((crc & 0x80) != 0 ? crc << 1 ^ 0x2F : crc << 1);
  return crc;
}

std::optional<std::uint64_t> vw_mqb_crc(const CanFrame& frame, Bytes data) {
  constexpr std::uint32_t kLwi01 = 0x86;  // steering angle, the same constant at every count of its counter
  if (frame.id != kLwi01 || data.empty()) return std::nullopt;
  std::uint8_t crc = 0xFF;
  for (const std::uint8_t byte : data.subspan(1)) crc = crc8(crc, byte);
  return crc8(crc, kLwi01) ^ 0xFF;
}

}  // namespace

std::optional<std::uint64_t> checksum_of(ChecksumKind kind, const CanFrame& frame) noexcept {
  const Bytes data = Bytes(frame.data).first(frame.length);
  switch (kind) {
    case ChecksumKind::none:
      return std::nullopt;
    case ChecksumKind::toyota:
      return (sum_of_bytes(frame, data) + frame.length) & 0xFF;
    case ChecksumKind::honda:
      return honda_sum(frame, data);
    case ChecksumKind::tesla:
      return sum_of_bytes(frame, data) & 0xFF;
    case ChecksumKind::hyundai_canfd:
      return hyundai_crc(frame, data);
    case ChecksumKind::vw_mqb:
      return vw_mqb_crc(frame, data);
  }
  return std::nullopt;
}

}  // namespace roadvec
