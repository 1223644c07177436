#include "tools/inspect/survey.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace roadvec {
namespace {

constexpr std::array kModels{LidarModel::hdl64e_s2,   LidarModel::hdl64e_s3, LidarModel::hdl32e, LidarModel::vlp16,
                             LidarModel::puck_hi_res, LidarModel::vlp32c,    LidarModel::vls128};

int banks_in(const PacketBytes& bytes) {
  int bank_count = 0;
  for (int block = 0; block < kBlocksPerPacket; ++block) {
    const auto* const flag = std::ranges::find(kBankFlags, block_flag(bytes, block));
    bank_count = std::max(bank_count, flag == kBankFlags.end() ? 0 : static_cast<int>(flag - kBankFlags.begin()) + 1);
  }
  return bank_count == 3 ? 0 : bank_count;
}

bool azimuths_pair(const PacketBytes& bytes, int bank_count) {
  for (int block = 0; block < kBlocksPerPacket; block += 2 * bank_count) {
    if (block_azimuth_cdeg(bytes, block) != block_azimuth_cdeg(bytes, block + bank_count)) return false;
  }
  return block_azimuth_cdeg(bytes, 0) != block_azimuth_cdeg(bytes, kBlocksPerPacket - 1);
}

/// Of a packet of the surveyed kind, if `model` had sent it.
std::int64_t expected_period_us(const Survey& survey, LidarModel model) {
  const ModelFacts& facts = facts_of(model);
  const bool dual = survey.dual_return && facts.dual != DualLayout::none;
  const int group_count = kBlocksPerPacket / group_layout(model, dual).block_count;
  return static_cast<std::int64_t>(group_count) * facts.group_period_ns / 1000;
}

}  // namespace

Survey survey(std::span<const RawPacket> packets) {
  Survey result;
  result.packet_count = packets.size();
  if (packets.empty()) return result;
  const PacketBytes& first = packets.front().bytes;
  result.bank_count = banks_in(first);
  const bool says_dual = first[kReturnModeOffset] == kDualReturnMode;
  result.dual_return = result.bank_count == 4   ? says_dual
                       : result.bank_count == 2 ? azimuths_pair(first, 2)
                                                : result.bank_count == 1 && says_dual && azimuths_pair(first, 1);
  result.product_id = first[kProductIdOffset];
  std::vector<std::int64_t> steps_us;
  for (std::size_t i = 1; i < packets.size(); ++i) {
    const std::int64_t step = std::int64_t{device_time_us(packets[i].bytes)} - device_time_us(packets[i - 1].bytes);
    if (step > 0) steps_us.push_back(step);
  }
  if (!steps_us.empty()) {
    // The lower tenth: losses make steps longer, never shorter.
    const auto tenth = steps_us.begin() + static_cast<std::ptrdiff_t>(steps_us.size() / 10);
    std::ranges::nth_element(steps_us, tenth);
    result.packet_period_us = *tenth;
  }
  return result;
}

std::optional<LidarModel> likely_model(const Survey& survey) {
  // Heads that fit alike (VLP-16 and Puck Hi-Res, HDL-32E and VLP-32C in part) are told apart by what they claim.
  std::optional<LidarModel> maybe_likely;
  for (const LidarModel model : kModels) {
    if (!misfit(survey, model).empty()) continue;
    const std::uint8_t id = facts_of(model).product_id;
    if (id != 0 && id == survey.product_id) return model;
    if (!maybe_likely) maybe_likely = model;
  }
  return maybe_likely;
}

std::string claimed_model(const Survey& survey) {
  if (survey.bank_count == 2) return "nothing (an HDL-64E sends status there)";
  for (const LidarModel model : kModels) {
    if (facts_of(model).product_id == survey.product_id) return std::string(name_of(model));
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "an unknown model (0x%02X)", survey.product_id);
  return text.data();
}

std::string misfit(const Survey& survey, LidarModel model) {
  const std::string name(name_of(model));
  const int bank_count = facts_of(model).bank_count;
  if (survey.bank_count != bank_count) {
    return "the packets have " + std::to_string(survey.bank_count) + " laser banks, a " + name + " has " +
           std::to_string(bank_count);
  }
  const std::int64_t expected_us = expected_period_us(survey, model);
  if (survey.packet_period_us != 0 && std::llabs(survey.packet_period_us - expected_us) > expected_us / 10) {
    return "a packet takes " + std::to_string(survey.packet_period_us) + " us, that of a " + name + " " +
           std::to_string(expected_us) + " us";
  }
  return "";
}

}  // namespace roadvec
