#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>

#include "core/base/time.h"

namespace roadvec {

inline constexpr std::size_t kMaxCanBytes = 64, kMaxClassicCanBytes = 8;
inline constexpr std::uint32_t kStandardCanIdMask = 0x7FF, kExtendedCanIdMask = 0x1FFFFFFF;

/// One CAN or CAN FD frame as a reader hands it over.
struct CanFrame {
  SensorTime time;
  std::uint32_t id = 0;   ///< 11 or 29 bits; error frames: the error classes of linux/can/error.h
  bool extended = false;  ///< 29-bit identifier
  bool fd = false;
  bool error = false;
  bool remote = false;
  std::uint8_t length = 0;     ///< bytes of `data` that were on the bus; remote frames: the length asked for
  std::uint8_t interface = 0;  ///< the reader's number of the interface
  std::array<std::uint8_t, kMaxCanBytes> data{};
};

/// What messages are told apart by.
struct CanId {
  std::uint32_t id = 0;
  bool extended = false;

  friend constexpr auto operator<=>(CanId, CanId) = default;
};

}  // namespace roadvec
