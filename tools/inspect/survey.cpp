#include "tools/inspect/survey.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace roadvec {
namespace {

/// What tells a model's packets. Periods in microseconds, as sent with one return of a firing and with two; 0: not
/// sent.
struct Trait {
  LidarModel model;
  std::string_view name;
  int bank_count;
  std::int64_t single_us, dual_us;
  std::uint8_t product_id;
};
// Periods from the makers' firing times, that of a VLS-128 as measured: its manuals give 160 to 173 us.
constexpr std::array<Trait, 7> kTraits{{{LidarModel::hdl64e_s2, "HDL-64E S2", 2, 288, 0, 0},
                                        {LidarModel::hdl64e_s3, "HDL-64E S3", 2, 346, 173, 0},
                                        {LidarModel::hdl32e, "HDL-32E", 1, 553, 276, 0x21},
                                        {LidarModel::vlp16, "VLP-16", 1, 1327, 664, 0x22},
                                        {LidarModel::puck_hi_res, "Puck Hi-Res", 1, 1327, 664, 0x24},
                                        {LidarModel::vlp32c, "VLP-32C", 1, 664, 332, 0x28},
                                        {LidarModel::vls128, "VLS-128", 4, 166, 55, 0xA1}}};

const Trait& trait_of(LidarModel model) { return *std::ranges::find(kTraits, model, &Trait::model); }

int bank_count_of(const PacketBytes& bytes) {
  int count = 0;
  for (int block = 0; block < kBlocksPerPacket; ++block) {
    const auto bank = std::ranges::find(kBankFlags, block_flag(bytes, block)) - kBankFlags.begin();
    if (bank < static_cast<std::ptrdiff_t>(kBankFlags.size())) count = std::max(count, static_cast<int>(bank) + 1);
  }
  return count;
}

/// The same azimuth in neighbouring groups of blocks, and not in all of them, as of a head that stands.
bool azimuths_repeat(const PacketBytes& bytes, int blocks_apart) {
  const int last = kBlocksPerPacket - 1;
  for (int block = 0; block + 2 * blocks_apart <= kBlocksPerPacket; block += 2 * blocks_apart) {
    if (block_azimuth_cdeg(bytes, block) != block_azimuth_cdeg(bytes, block + blocks_apart)) return false;
  }
  return block_azimuth_cdeg(bytes, 0) != block_azimuth_cdeg(bytes, last);
}

bool is_dual(const PacketBytes& bytes, int bank_count) {
  if (bank_count == 2) return azimuths_repeat(bytes, 2);
  if (bank_count == 4) return block_flag(bytes, 0) == block_flag(bytes, 1);
  return bytes[kReturnModeOffset] == kDualReturnMode && azimuths_repeat(bytes, 1);
}

std::string hex(const char* format, unsigned value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

}  // namespace

Survey survey(std::span<const RawPacket> packets) {
  Survey result;
  result.packet_count = packets.size();
  if (packets.empty()) return result;
  const PacketBytes& first = packets.front().bytes;
  result.bank_count = bank_count_of(first);
  result.return_mode = first[kReturnModeOffset];
  result.product_id = first[kProductIdOffset];
  // One packet may lie at a place where neighbouring readings are equal by chance.
  const auto dual_count =
      std::ranges::count_if(packets, [&](const RawPacket& packet) { return is_dual(packet.bytes, result.bank_count); });
  result.dual_return = 2 * dual_count > static_cast<std::ptrdiff_t>(packets.size());
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

std::string_view model_text(LidarModel model) { return trait_of(model).name; }

std::optional<LidarModel> likely_model(const Survey& survey) {
  std::optional<LidarModel> likely;
  for (const Trait& trait : kTraits) {
    if (!misfit(survey, trait.model).empty()) continue;
    if (!likely || trait.product_id == survey.product_id) likely = trait.model;
  }
  return likely;
}

std::string claimed_model(const Survey& survey) {
  if (survey.bank_count == 2) return "nothing (an HDL-64E sends status there)";
  for (const Trait& trait : kTraits) {
    if (trait.product_id == survey.product_id) return std::string(trait.name);
  }
  return hex("an unknown model (0x%02X)", survey.product_id);
}

std::string return_mode(const Survey& survey) {
  if (survey.dual_return) return "dual";
  if (survey.bank_count == 2) return "single";
  if (survey.return_mode == kStrongestReturnMode) return "strongest";
  if (survey.return_mode == kLastReturnMode) return "last";
  return hex("unknown (0x%02X, old firmware)", survey.return_mode);
}

std::string misfit(const Survey& survey, LidarModel model) {
  const Trait& trait = trait_of(model);
  const std::string name(trait.name);
  if (survey.bank_count != trait.bank_count) {
    return "the packets have " + std::to_string(survey.bank_count) + " laser banks, a " + name + " has " +
           std::to_string(trait.bank_count);
  }
  const std::int64_t expected_us = survey.dual_return ? trait.dual_us : trait.single_us;
  if (expected_us == 0) return "the packets hold two returns of a firing, a " + name + " sends one";
  if (survey.packet_period_us != 0 && std::llabs(survey.packet_period_us - expected_us) > expected_us / 12) {
    return "a packet takes " + std::to_string(survey.packet_period_us) + " us, that of a " + name + " " +
           std::to_string(expected_us) + " us";
  }
  return "";
}

}  // namespace roadvec
