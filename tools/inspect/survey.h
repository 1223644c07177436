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
  int bank_count = 0;  ///< kinds of blocks: 1 below 64 lasers, 2 an HDL-64E, 4 a VLS-128; 0: none that is known
  bool dual_return = false;
  std::int64_t packet_period_us = 0;  ///< by the sensor's clock
  std::uint8_t return_mode = 0, product_id = 0;
};
[[nodiscard]] Survey survey(std::span<const RawPacket> packets);

/// The model whose layout and packet rate these are. The product id is asked last, between models that are alike in
/// both, because it lies.
[[nodiscard]] std::optional<LidarModel> likely_model(const Survey& survey);
/// By the name of configurations, for every model, also those that are not decoded.
[[nodiscard]] std::string_view model_text(LidarModel model);
/// "HDL-32E" for the id byte of a packet; "nothing" for an HDL-64E, "an unknown model (0x..)" else.
[[nodiscard]] std::string claimed_model(const Survey& survey);
/// "strongest", "last", "dual", "single" (an HDL-64E does not say which), "unknown (0x..)".
[[nodiscard]] std::string return_mode(const Survey& survey);
/// Why the packets cannot be `model`'s; empty if they can.
[[nodiscard]] std::string misfit(const Survey& survey, LidarModel model);

}  // namespace roadvec
