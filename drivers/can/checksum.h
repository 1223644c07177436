#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "drivers/can/frame.h"

namespace roadvec {

/// How car makers protect the data of a message. [opendbc]
enum class ChecksumKind : std::uint8_t {
  none,
  toyota,         ///< sum of the id's bytes, the length and the data
  honda,          ///< sum of the nibbles of id and data, subtracted from 8; ids of 29 bits 3 more
  tesla,          ///< sum of the id's bytes and the data
  hyundai_canfd,  ///< CRC-16, polynomial 0x1021, of the data behind the checksum and the id, and a constant per length
  vw_mqb,         ///< CRC-8, polynomial 0x2F, of the data behind the checksum and a constant per message
};
inline constexpr const char* kChecksumNames[] = {"", "toyota", "honda", "tesla", "hyundai_canfd", "vw_mqb"};

/// The checksum that `frame` ought to carry. Its own bits are 0 when this is called: the sums count every byte.
/// Nothing: the constant of this message, or of this length, is not known.
[[nodiscard]] std::optional<std::uint64_t> checksum_of(ChecksumKind kind, const CanFrame& frame) noexcept;

}  // namespace roadvec
