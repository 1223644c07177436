#include "drivers/velodyne/decode.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstring>

#include "core/base/angle.h"
#include "core/base/ensure.h"

namespace roadvec {
namespace {

/// No head turns faster; a larger step between two readings is damage, not motion.
constexpr int kFastestHead_rps = 40;
/// Half of what the slowest head turns between two readings.
constexpr double kSlowestTurn_cdeg = 3.5;
/// A turn is taken from two packets no farther apart: longer, and the head may have gone round.
constexpr std::uint32_t kLongestStep_us = 5'000;

// The second half of a Return as one number.
constexpr unsigned kLaserShift = 8 * (offsetof(Return, laser) - offsetof(Return, time_ns));
constexpr unsigned kIntensityShift = 8 * (offsetof(Return, intensity) - offsetof(Return, time_ns));
constexpr unsigned kKindShift = 8 * (offsetof(Return, kind) - offsetof(Return, time_ns));
static_assert(std::endian::native == std::endian::little && offsetof(Return, time_ns) == 16);

}  // namespace

PacketDecoder::PacketDecoder(LidarModel model, const Calibration& calibration, const DecodeOptions& options,
                             LidarCounters& counters)
    : model_(model),
      facts_(facts_of(model)),
      counters_(counters),
      options_(options),
      max_turn_cdeg_(static_cast<int>(kFullCircle_cdeg * kFastestHead_rps * (facts_.group_period_ns * 1e-9))),
      single_(make_mode(false)) {
  if (facts_.dual != DualLayout::none) dual_ = make_mode(true);
  if (!calibration.streamed) calibrate(calibration);
}

void PacketDecoder::calibrate(const Calibration& calibration) noexcept {
  ENSURE(calibration.lasers.size() == static_cast<std::size_t>(facts_.laser_count));
  const bool follow_turn = options_.maybe_follow_turn.value_or(facts_.follow_turn);
  beam_options_.distance_lsb_m = static_cast<float>(calibration.distance_lsb_m.value_or(facts_.distance_lsb_m));
  beam_options_.correction = options_.correction;
  beam_options_.corrects_intensity = false;
  for (int b = 0; b < facts_.bank_count; ++b) {
    for (int lane = 0; lane < kLanesPerBlock; ++lane) {
      const LaserCalibration& laser = calibration.lasers[static_cast<std::size_t>(laser_of(model_, b, lane))];
      const double turn_share = static_cast<double>(lane_time_ns(model_, b, lane)) / facts_.group_period_ns;
      banks_[static_cast<std::size_t>(b)].set(lane, laser, follow_turn ? turn_share : 0.0, options_.correction);
      beam_options_.corrects_intensity |=
          laser.focal_slope != 0 || laser.min_intensity > 0 || laser.max_intensity < 255;
    }
  }
}

PacketDecoder::Mode PacketDecoder::make_mode(bool dual) const {
  Mode mode{.layout = group_layout(model_, dual)};
  const int echo_count = dual ? 2 : 1;
  for (int b = 0; b < facts_.bank_count; ++b) {
    for (int lane = 0; lane < kLanesPerBlock; ++lane) {
      for (int echo = 0; echo < echo_count; ++echo) {
        mode.order[mode.echo_count++] = {
            .tail = lane_time_ns(model_, b, lane) | static_cast<std::uint64_t>(laser_of(model_, b, lane))
                                                        << kLaserShift,
            .point = static_cast<std::uint32_t>((b * echo_count + echo) * kLanesPerBlock + lane)};
      }
    }
  }
  std::stable_sort(mode.order.begin(), mode.order.begin() + static_cast<std::ptrdiff_t>(mode.echo_count),
                   [](const Emission& a, const Emission& b) {
                     return static_cast<std::uint32_t>(a.tail) < static_cast<std::uint32_t>(b.tail);
                   });
  return mode;
}

bool PacketDecoder::decode(const PacketBytes& bytes, DecodedPacket& packet) noexcept {
  if (in_unread_mode(bytes)) {
    counters_.unread_mode.add();
    return false;
  }
  const bool dual = has_dual_return(bytes);
  const Mode& mode = dual ? dual_ : single_;
  if (!laid_out_as(mode.layout, bytes)) {
    counters_.wrong_flags.add();
    return false;
  }
  if (facts_.product_id != 0 && bytes[kProductIdOffset] != facts_.product_id) ++other_product_id_count_;

  packet.dual_return = dual;
  packet.group_count = kBlocksPerPacket / mode.layout.block_count;
  packet.return_count = 0;
  read_azimuths(bytes, mode.layout, packet);
  update_turn(bytes, packet);

  for (int g = 0; g < packet.group_count; ++g) {
    DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    group.returns_begin = packet.return_count;
    if (group.usable) {
      const Heading heading = heading_at(group.azimuth_cdeg);
      for (int i = 0; i < mode.layout.block_count; ++i) {
        const GroupLayout::Block& role = mode.layout.blocks[static_cast<std::size_t>(i)];
        const std::size_t block = role.bank * (dual ? 2U : 1U) + role.echo;
        const std::size_t at = static_cast<std::size_t>(g * mode.layout.block_count + i) * kBlockBytes;
        place_echoes(bytes.data() + at + kBlockEchoesOffset, banks_[role.bank], heading, beam_options_, points_,
                     block * kLanesPerBlock);
      }
      if (dual) {
        merge_equal_returns(mode.layout);
        emit<true>(mode, group.start_ns, packet);
      } else {
        emit<false>(mode, group.start_ns, packet);
      }
    }
    group.returns_end = packet.return_count;
  }
  return true;
}

bool PacketDecoder::laid_out_as(const GroupLayout& layout, const PacketBytes& bytes) const noexcept {
  const int used = kBlocksPerPacket / layout.block_count * layout.block_count;
  for (int block = 0; block < kBlocksPerPacket; ++block) {
    const std::uint16_t flag = block_flag(bytes, block);
    const bool right =
        block < used ? flag == kBankFlags[layout.blocks[static_cast<std::size_t>(block % layout.block_count)].bank]
                     : flag == kEmptyBlockFlags[0] || flag == kEmptyBlockFlags[1];
    if (!right) return false;
  }
  return true;
}

/// A VLS-128 can also send three returns, or two with their confidence: every third block then means something else.
bool PacketDecoder::in_unread_mode(const PacketBytes& bytes) const noexcept {
  const std::uint8_t mode = bytes[kReturnModeOffset];
  return model_ == LidarModel::vls128 && (mode == kTripleReturnMode || mode == kConfidenceReturnMode);
}

/// The mode byte alone is not enough: an HDL-32E before firmware 2.2.20 leaves anything there. An HDL-64E has none: its
/// azimuths tell by coming in pairs, but those of a head that stands are all alike, and then it is as it was before.
bool PacketDecoder::has_dual_return(const PacketBytes& bytes) noexcept {
  if (facts_.dual == DualLayout::none) return false;
  if (facts_.has_return_mode && bytes[kReturnModeOffset] != kDualReturnMode) return false;
  if (facts_.bank_count == kMaxBanks) return true;  // its flags come in pairs too: laid_out_as() looks at them
  const int pair = facts_.bank_count;
  for (int block = 0; block < kBlocksPerPacket; block += 2 * pair) {
    if (block_azimuth_cdeg(bytes, block) != block_azimuth_cdeg(bytes, block + pair)) return standing_was_dual_ = false;
  }
  const bool stands = block_azimuth_cdeg(bytes, 0) == block_azimuth_cdeg(bytes, kBlocksPerPacket - 1);
  if (!facts_.has_return_mode && stands) return standing_was_dual_;
  return standing_was_dual_ = true;
}

void PacketDecoder::read_azimuths(const PacketBytes& bytes, const GroupLayout& layout, DecodedPacket& packet) noexcept {
  for (int g = 0; g < packet.group_count; ++g) {
    DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    group.azimuth_cdeg = block_azimuth_cdeg(bytes, g * layout.block_count);
    group.usable = group.azimuth_cdeg < kFullCircle_cdeg;
    if (!group.usable) counters_.wrong_azimuth.add();
  }
}

/// How far the head turns from one reading to the next. Where the readings make no sense, it turns as it did before.
void PacketDecoder::update_turn(const PacketBytes& bytes, DecodedPacket& packet) noexcept {
  std::optional<double> maybe_turn_cdeg = place_groups(packet);
  if (packet.group_count == 1) maybe_turn_cdeg = turn_since_last(bytes, packet);
  if (packet.groups[0].usable) {
    last_azimuth_cdeg_ = packet.groups[0].azimuth_cdeg;
    last_device_us_ = device_time_us(bytes);
  }
  if (maybe_turn_cdeg && *maybe_turn_cdeg >= 0 && *maybe_turn_cdeg <= max_turn_cdeg_) turn_cdeg_ = *maybe_turn_cdeg;
  const auto turn_rad = static_cast<float>(rad_from_deg(turn_cdeg_ / 100.0));
  for (int b = 0; b < facts_.bank_count; ++b) banks_[static_cast<std::size_t>(b)].turn_by(turn_rad);
}

/// Says when each group began, and gives the mean turn over the packet, because a single step is no truer than the
/// encoder (0.09 degrees on an HDL-64E) [velodyne_decoder]. A single leap ahead is a sector left out, and takes its
/// time; two are a damaged reading.
std::optional<double> PacketDecoder::place_groups(DecodedPacket& packet) const noexcept {
  int last = -1, leap_count = 0, leap_at = 0, leap_cdeg = 0, step_count = 0, turned_cdeg = 0;
  for (int g = 0; g < packet.group_count; ++g) {
    DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    group.start_ns = static_cast<std::uint32_t>(g) * facts_.group_period_ns;
    if (!group.usable) continue;
    if (last >= 0) {
      const int step_cdeg =
          azimuth_step_cdeg(packet.groups[static_cast<std::size_t>(last)].azimuth_cdeg, group.azimuth_cdeg);
      if (step_cdeg >= -kLargestStep_cdeg && step_cdeg <= kLargestStep_cdeg * (g - last)) {
        turned_cdeg += step_cdeg;
        step_count += g - last;
      } else {
        ++leap_count;
        leap_at = g;
        leap_cdeg = step_cdeg < 0 ? step_cdeg + kFullCircle_cdeg : step_cdeg;
      }
    }
    last = g;
  }
  const double turn_cdeg = step_count > 0 ? static_cast<double>(turned_cdeg) / step_count : 0.0;
  if (leap_count == 1 && turn_cdeg >= kSlowestTurn_cdeg) {
    const auto left_out_ns = static_cast<std::uint32_t>((leap_cdeg - turn_cdeg) / turn_cdeg * facts_.group_period_ns);
    for (int g = leap_at; g < packet.group_count; ++g)
      packet.groups[static_cast<std::size_t>(g)].start_ns += left_out_ns;
  }
  if (step_count == 0) return std::nullopt;
  return turn_cdeg;
}

/// A packet of one group says nothing about the turn: by the packet before it and the sensor's own clock.
std::optional<double> PacketDecoder::turn_since_last(const PacketBytes& bytes,
                                                     const DecodedPacket& packet) const noexcept {
  const std::uint32_t step_us = device_time_us(bytes) - last_device_us_;
  if (!packet.groups[0].usable || last_azimuth_cdeg_ >= kFullCircle_cdeg || step_us == 0 || step_us > kLongestStep_us) {
    return std::nullopt;
  }
  const int turned_cdeg = azimuth_step_cdeg(last_azimuth_cdeg_, packet.groups[0].azimuth_cdeg);
  return turned_cdeg * (facts_.group_period_ns * 1e-3) / step_us;
}

/// One echo that is both strongest and last is sent as both.
void PacketDecoder::merge_equal_returns(const GroupLayout& layout) noexcept {
  for (std::size_t bank = 0; bank < static_cast<std::size_t>(facts_.bank_count); ++bank) {
    for (std::size_t lane = 0; lane < kLanesPerBlock; ++lane) {
      const std::size_t first = 2 * bank * kLanesPerBlock + lane, second = first + kLanesPerBlock;
      const bool same = points_.raw[first] == points_.raw[second];
      if (same) points_.raw[first] = 0;
      kinds_[first] = layout.kinds[0];
      kinds_[second] = same ? ReturnKind::both : layout.kinds[1];
    }
  }
}

template <bool kDual>
void PacketDecoder::emit(const Mode& mode, std::uint32_t group_time_ns, DecodedPacket& packet) const noexcept {
  Return* out = packet.returns.data() + packet.return_count;
  for (std::size_t k = 0; k < mode.echo_count; ++k) {
    const Emission& emission = mode.order[k];
    const std::size_t i = emission.point;
    std::uint64_t tail = emission.tail + group_time_ns;
    tail |= static_cast<std::uint64_t>(points_.intensity[i]) << kIntensityShift;
    if constexpr (kDual) tail |= static_cast<std::uint64_t>(kinds_[i]) << kKindShift;
    // Written before it is known to be one, and in two pieces: the next echo overwrites a blank, which is cheaper than
    // a branch that misses.
    auto* const bytes = reinterpret_cast<std::byte*>(out);
    std::memcpy(bytes, &points_.place[i], sizeof points_.place[i]);
    std::memcpy(bytes + offsetof(Return, time_ns), &tail, sizeof tail);
    out += points_.raw[i] != 0 ? 1 : 0;
  }
  packet.return_count = static_cast<std::uint32_t>(out - packet.returns.data());
}

}  // namespace roadvec
