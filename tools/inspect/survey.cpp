#include "tools/inspect/survey.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace roadvec {
namespace {

constexpr std::array kDecodedModels{LidarModel::hdl64e_s2, LidarModel::hdl32e, LidarModel::vlp16};

bool flags_alternate(const PacketBytes& bytes) {
  return block_flag(bytes, 1) == kBankFlags[1] && block_flag(bytes, 2) == kBankFlags[0];
}

bool azimuths_pair(const PacketBytes& bytes) {
  for (int block = 0; block < kBlocksPerPacket; block += 2) {
    if (block_azimuth_cdeg(bytes, block) != block_azimuth_cdeg(bytes, block + 1)) return false;
  }
  return block_azimuth_cdeg(bytes, 0) != block_azimuth_cdeg(bytes, kBlocksPerPacket - 1);
}

/// Of a packet of the surveyed kind, if `model` had sent it.
std::int64_t expected_period_us(const Survey& survey, LidarModel model) {
  const ModelFacts& facts = facts_of(model);
  const int group_count = kBlocksPerPacket / facts.bank_count / (survey.dual_return ? 2 : 1);
  return static_cast<std::int64_t>(group_count) * facts.group_period_ns / 1000;
}

}  // namespace

Survey survey(std::span<const RawPacket> packets) {
  Survey result;
  result.packet_count = packets.size();
  if (packets.empty()) return result;
  const PacketBytes& first = packets.front().bytes;
  result.banks_alternate = flags_alternate(first);
  result.dual_return = !result.banks_alternate && first[kReturnModeOffset] == kDualReturnMode && azimuths_pair(first);
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
  for (const LidarModel model : kDecodedModels) {
    if (misfit(survey, model).empty()) return model;
  }
  return std::nullopt;
}

std::string claimed_model(const Survey& survey) {
  if (survey.banks_alternate) return "nothing (an HDL-64E sends status there)";
  for (const LidarModel model : kDecodedModels) {
    if (facts_of(model).product_id == survey.product_id) return std::string(name_of(model));
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "an unknown model (0x%02X)", survey.product_id);
  return text.data();
}

std::string misfit(const Survey& survey, LidarModel model) {
  const std::string name(name_of(model));
  const bool needs_two_banks = facts_of(model).bank_count == 2;
  if (survey.banks_alternate != needs_two_banks) {
    return survey.banks_alternate ? "the packets have the two laser banks of an HDL-64E, a " + name + " has one"
                                  : "the packets have one laser bank, a " + name + " has two";
  }
  const std::int64_t expected_us = expected_period_us(survey, model);
  if (survey.packet_period_us != 0 && std::llabs(survey.packet_period_us - expected_us) > expected_us / 10) {
    return "a packet takes " + std::to_string(survey.packet_period_us) + " us, that of a " + name + " " +
           std::to_string(expected_us) + " us";
  }
  return "";
}

}  // namespace roadvec
