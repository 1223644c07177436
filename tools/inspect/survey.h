#pragma once

#include <optional>
#include <span>
#include <string>

#include "drivers/velodyne/model.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {

/// What the first packets of a recording give away about the head that sent them.
struct Survey {
  std::size_t packet_count = 0;
  int bank_count = 0;  ///< laser banks in the blocks' flags: 1; 2 is an HDL-64E, 4 a VLS-128; 0: no head sends that
  bool dual_return = false;
  std::int64_t packet_period_us = 0;  ///< by the sensor's clock
  std::uint8_t product_id = 0;
};
[[nodiscard]] Survey survey(std::span<const RawPacket> packets);

/// The model whose layout and packet rate these are; the product id is not asked, because it lies.
[[nodiscard]] std::optional<LidarModel> likely_model(const Survey& survey);
/// "HDL-32E" for the id byte of a packet; "nothing" for an HDL-64E, "an unknown model (0x..)" else.
[[nodiscard]] std::string claimed_model(const Survey& survey);
/// Why the packets cannot be `model`'s; empty if they can.
[[nodiscard]] std::string misfit(const Survey& survey, LidarModel model);

}  // namespace roadvec
