#include "drivers/velodyne/decode.h"

#include <algorithm>
#include <cmath>

#include "core/base/angle.h"
#include "core/base/ensure.h"

namespace roadvec {
namespace {

// Distances at which the lasers were calibrated [VelodyneHDL64ES3, app. F].
constexpr double kFar_m = 25.04, kNearX_m = 2.4, kNearY_m = 1.93;
constexpr double kFocalRange_m = 131.0;  ///< 65535 steps of 2 mm
/// No head turns faster; a larger step between two readings is damage, not motion.
constexpr int kFastestHead_rps = 40;

/// Sine and cosine of a whole azimuth word from two small tables: degrees, and hundredths.
struct AzimuthTable {
  struct Entry {
    double sin, cos;
  };
  std::array<Entry, 360> degrees;
  std::array<Entry, 100> hundredths;

  AzimuthTable() {
    for (std::size_t i = 0; i < degrees.size(); ++i) degrees[i] = entry(static_cast<double>(i));
    for (std::size_t i = 0; i < hundredths.size(); ++i) hundredths[i] = entry(static_cast<double>(i) / 100.0);
  }
  static Entry entry(double deg) { return {std::sin(rad_from_deg(deg)), std::cos(rad_from_deg(deg))}; }
  [[nodiscard]] Entry at(std::uint16_t cdeg) const noexcept {
    const Entry a = degrees[cdeg / 100], b = hundredths[cdeg % 100];
    return {a.sin * b.cos + a.cos * b.sin, a.cos * b.cos - a.sin * b.sin};
  }
};
const AzimuthTable kAzimuths;

float focal_level(double focal_distance_m) {
  const double closeness = 1.0 - focal_distance_m / kFocalRange_m;
  return static_cast<float>(256.0 * closeness * closeness);
}

}  // namespace

PacketDecoder::PacketDecoder(LidarModel model, const Calibration& calibration, const DecodeOptions& options,
                             LidarCounters& counters)
    : model_(model),
      facts_(facts_of(model)),
      counters_(counters),
      distance_lsb_m_(static_cast<float>(calibration.distance_lsb_m.value_or(facts_.distance_lsb_m))),
      max_turn_cdeg_(static_cast<int>(kFullCircle_cdeg * kFastestHead_rps * (facts_.group_period_ns * 1e-9))) {
  ENSURE(facts_.supported && facts_.bank_count <= kMaxBanks);
  ENSURE(calibration.lasers.size() == static_cast<std::size_t>(facts_.laser_count));
  const bool follow_turn = options.maybe_follow_turn.value_or(facts_.follow_turn);
  const auto f = [](double value) { return static_cast<float>(value); };
  for (int b = 0; b < facts_.bank_count; ++b) {
    Bank& bank = banks_[static_cast<std::size_t>(b)];
    for (int lane = 0; lane < kLanesPerBlock; ++lane) {
      const auto j = static_cast<std::size_t>(lane);
      const LaserCalibration& laser = calibration.lasers[static_cast<std::size_t>(laser_of(model, b, lane))];
      const bool two_point = laser.distance_x_m != 0 && laser.distance_y_m != 0;
      bank.rotation_rad[j / 4][j % 4] = f(wrap_rad(laser.rotation_rad));
      bank.sin_rotation[j / 4][j % 4] = f(std::sin(laser.rotation_rad));
      bank.cos_rotation[j / 4][j % 4] = f(std::cos(laser.rotation_rad));
      bank.sin_elevation[j / 4][j % 4] = f(std::sin(laser.elevation_rad));
      bank.cos_elevation[j / 4][j % 4] = f(std::cos(laser.elevation_rad));
      bank.turn_share[j / 4][j % 4] =
          follow_turn ? f(static_cast<double>(lane_time_ns(model, lane)) / facts_.group_period_ns) : 0.0F;
      bank.far_m[j / 4][j % 4] = f(laser.distance_m);
      bank.near_x[j / 4][j % 4] = two_point ? f((laser.distance_x_m - laser.distance_m) / (kFar_m - kNearX_m)) : 0.0F;
      bank.near_y[j / 4][j % 4] = two_point ? f((laser.distance_y_m - laser.distance_m) / (kFar_m - kNearY_m)) : 0.0F;
      bank.vertical_m[j / 4][j % 4] = f(laser.vertical_offset_m);
      bank.horizontal_m[j / 4][j % 4] = f(laser.horizontal_offset_m);
      bank.focal_slope[j / 4][j % 4] = f(laser.focal_slope);
      bank.focal_level[j / 4][j % 4] = focal_level(laser.focal_distance_m);
      bank.min_intensity[j / 4][j % 4] = f(std::clamp(laser.min_intensity, 0.0, 255.0));
      bank.max_intensity[j / 4][j % 4] = f(std::clamp(laser.max_intensity, 0.0, 255.0));
      corrects_intensity_ |= laser.focal_slope != 0 || laser.min_intensity > 0 || laser.max_intensity < 255;
      bank.distance_mask[j] = laser.enabled ? -1 : 0;
    }
  }
  for (int lane = 0; lane < kLanesPerBlock; ++lane) {
    const auto emission = [&](int half, int bank) {
      return Emission{lane_time_ns(model, lane), static_cast<std::uint8_t>(half * kLanesPerBlock + lane),
                      static_cast<std::uint8_t>(laser_of(model, bank, lane))};
    };
    for (int b = 0; b < facts_.bank_count; ++b) single_order_.push_back(emission(b, b));
    for (int half = 0; half < 2; ++half) dual_order_.push_back(emission(half, 0));
  }
}

bool PacketDecoder::decode(const PacketBytes& bytes, DecodedPacket& packet) noexcept {
  if (!laid_out_as_model(bytes)) {
    counters_.wrong_flags.add();
    return false;
  }
  if (facts_.product_id != 0 && bytes[kProductIdOffset] != facts_.product_id) ++other_product_id_count_;

  packet.dual_return = has_dual_return(bytes);
  const int blocks_per_group = facts_.bank_count * (packet.dual_return ? 2 : 1);
  packet.group_count = kBlocksPerPacket / blocks_per_group;
  packet.return_count = 0;
  read_azimuths(bytes, packet);
  update_turn(packet);
  update_offsets();

  for (int g = 0; g < packet.group_count; ++g) {
    DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    group.returns_begin = packet.return_count;
    if (group.usable) {
      const Heading heading = heading_at(group.azimuth_cdeg);
      for (int half = 0; half < blocks_per_group; ++half) {
        const auto block = static_cast<std::size_t>(g * blocks_per_group + half);
        const Bank& bank = banks_[packet.dual_return ? 0 : static_cast<std::size_t>(half)];
        decode_block(bytes.data() + block * kBlockBytes + kBlockEchoesOffset, bank, heading,
                     static_cast<std::size_t>(half) * kLanesPerBlock);
      }
      if (packet.dual_return) merge_equal_returns();
      emit(static_cast<std::uint32_t>(g) * facts_.group_period_ns, packet);
    }
    group.returns_end = packet.return_count;
  }
  return true;
}

bool PacketDecoder::laid_out_as_model(const PacketBytes& bytes) const noexcept {
  for (int block = 0; block < kBlocksPerPacket; ++block) {
    if (block_flag(bytes, block) != kBankFlags[static_cast<std::size_t>(block % facts_.bank_count)]) return false;
  }
  return true;
}

/// The mode byte alone is not enough: an HDL-32E before firmware 2.2.20 leaves anything there.
bool PacketDecoder::has_dual_return(const PacketBytes& bytes) const noexcept {
  if (!facts_.has_return_mode || bytes[kReturnModeOffset] != kDualReturnMode) return false;
  for (int block = 0; block < kBlocksPerPacket; block += 2) {
    if (block_azimuth_cdeg(bytes, block) != block_azimuth_cdeg(bytes, block + 1)) return false;
  }
  return true;
}

void PacketDecoder::read_azimuths(const PacketBytes& bytes, DecodedPacket& packet) noexcept {
  const int blocks_per_group = kBlocksPerPacket / packet.group_count;
  for (int g = 0; g < packet.group_count; ++g) {
    DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    group.azimuth_cdeg = block_azimuth_cdeg(bytes, g * blocks_per_group);
    group.usable = group.azimuth_cdeg < kFullCircle_cdeg;
    if (!group.usable) counters_.wrong_azimuth.add();
  }
}

/// How far the head turns from one reading to the next: the mean over the packet, because a single step is no truer
/// than the encoder (0.09 degrees on an HDL-64E) [velodyne_decoder]. Where the readings make no sense, it turns as it
/// did before.
void PacketDecoder::update_turn(const DecodedPacket& packet) noexcept {
  const auto usable = [&](int g) { return packet.groups[static_cast<std::size_t>(g)].usable; };
  int first = 0, last = packet.group_count - 1;
  while (first < last && !usable(first)) ++first;
  while (last > first && !usable(last)) --last;
  if (first == last) return;
  const int turned_cdeg = azimuth_step_cdeg(packet.groups[static_cast<std::size_t>(first)].azimuth_cdeg,
                                            packet.groups[static_cast<std::size_t>(last)].azimuth_cdeg);
  const int step_count = last - first;
  if (turned_cdeg < 0 || turned_cdeg > max_turn_cdeg_ * step_count) return;
  turn_rad_ = static_cast<float>(rad_from_deg(turned_cdeg / (100.0 * step_count)));
}

PacketDecoder::Heading PacketDecoder::heading_at(std::uint16_t azimuth_cdeg) noexcept {
  const AzimuthTable::Entry entry = kAzimuths.at(azimuth_cdeg);
  return {static_cast<float>(rad_from_deg(azimuth_cdeg / 100.0)), static_cast<float>(entry.sin),
          static_cast<float>(entry.cos)};
}

/// The turn is the same for all blocks of a packet, and so is each beam's offset from the azimuth as read.
void PacketDecoder::update_offsets() noexcept {
  for (Bank& bank : banks_) {
    for (std::size_t quad = 0; quad < kQuads; ++quad) {
      // The turn stays below 1.6 degrees (40 turns a second in 111 us): the series are exact to 1e-7.
      const Float4 turn = turn_rad_ * bank.turn_share[quad];
      const Float4 sin_turn = turn - turn * turn * turn * (1.0F / 6.0F);
      const Float4 cos_turn = 1.0F - turn * turn * 0.5F;
      bank.offset_rad[quad] = turn - bank.rotation_rad[quad];
      bank.sin_offset[quad] = sin_turn * bank.cos_rotation[quad] - cos_turn * bank.sin_rotation[quad];
      bank.cos_offset[quad] = cos_turn * bank.cos_rotation[quad] + sin_turn * bank.sin_rotation[quad];
    }
  }
}

/// Every lane is worked out, echo or not: no branch, four lanes at a time.
void PacketDecoder::decode_block(const std::uint8_t* echoes, const Bank& bank, const Heading& heading,
                                 std::size_t first_point) noexcept {
  Lanes raw;
  for (std::size_t quad = 0; quad < kQuads; ++quad) {
    const std::uint8_t* const echo = echoes + 4 * quad * kEchoBytes;
    const Int4 distance =
        Int4{echo[0] | echo[1] << 8, echo[3] | echo[4] << 8, echo[6] | echo[7] << 8, echo[9] | echo[10] << 8} &
        load<Int4>(&bank.distance_mask[4 * quad]);
    store(distance, &points_.raw[first_point + 4 * quad]);
    store(Int4{echo[2], echo[5], echo[8], echo[11]}, &points_.intensity[first_point + 4 * quad]);
    raw[quad] = __builtin_convertvector(distance, Float4);
  }
  place_block(raw, bank, heading, first_point);
  if (corrects_intensity_) correct_intensity(raw, bank, first_point);
}

void PacketDecoder::place_block(const Lanes& raw, const Bank& bank, const Heading& heading,
                                std::size_t first_point) noexcept {
  constexpr auto kTwoPi_f = static_cast<float>(kTwoPi);
  constexpr auto kFar_f = static_cast<float>(kFar_m);
  const Float4 full_circle = Float4{} + kTwoPi_f;
  for (std::size_t quad = 0; quad < kQuads; ++quad) {
    const Float4 sin_a = heading.sin * bank.cos_offset[quad] + heading.cos * bank.sin_offset[quad];
    const Float4 cos_a = heading.cos * bank.cos_offset[quad] - heading.sin * bank.sin_offset[quad];
    const Float4 flat_sin = bank.cos_elevation[quad] * sin_a, flat_cos = bank.cos_elevation[quad] * cos_a;

    const Float4 raw_m = raw[quad] * distance_lsb_m_;
    const Float4 far_m = raw_m + bank.far_m[quad];
    const Int4 is_near = raw_m < kFar_f;
    const Float4 near_x_m = where(is_near, bank.near_x[quad] * (kFar_f - absolute(far_m * flat_sin)));
    const Float4 near_y_m = where(is_near, bank.near_y[quad] * (kFar_f - absolute(far_m * flat_cos)));
    const Float4 left_m = bank.horizontal_m[quad] * cos_a - (far_m + near_x_m) * flat_sin;
    const Float4 ahead_m = bank.horizontal_m[quad] * sin_a + (far_m + near_y_m) * flat_cos;
    const Float4 up_m = (far_m + 0.5F * (near_x_m + near_y_m)) * bank.sin_elevation[quad] + bank.vertical_m[quad];

    Float4 azimuth_rad = heading.azimuth_rad + bank.offset_rad[quad];
    azimuth_rad += where(azimuth_rad < 0.0F, full_circle);
    azimuth_rad -= where(azimuth_rad >= kTwoPi_f, full_circle);

    // Columns to rows: a 4 x 4 transposition.
    const Float4 xy01 = __builtin_shufflevector(ahead_m, left_m, 0, 4, 1, 5);
    const Float4 xy23 = __builtin_shufflevector(ahead_m, left_m, 2, 6, 3, 7);
    const Float4 za01 = __builtin_shufflevector(up_m, azimuth_rad, 0, 4, 1, 5);
    const Float4 za23 = __builtin_shufflevector(up_m, azimuth_rad, 2, 6, 3, 7);
    Float4* const place = &points_.place[first_point + 4 * quad];
    place[0] = __builtin_shufflevector(xy01, za01, 0, 1, 4, 5);
    place[1] = __builtin_shufflevector(xy01, za01, 2, 3, 6, 7);
    place[2] = __builtin_shufflevector(xy23, za23, 0, 1, 4, 5);
    place[3] = __builtin_shufflevector(xy23, za23, 2, 3, 6, 7);
  }
}

void PacketDecoder::correct_intensity(const Lanes& raw, const Bank& bank, std::size_t first_point) noexcept {
  for (std::size_t quad = 0; quad < kQuads; ++quad) {
    std::int32_t* const stored = &points_.intensity[first_point + 4 * quad];
    const Float4 closeness = 1.0F - raw[quad] * (1.0F / 65535.0F);
    const Float4 level = absolute(bank.focal_level[quad] - 256.0F * closeness * closeness);
    Float4 intensity = __builtin_convertvector(load<Int4>(stored), Float4) + bank.focal_slope[quad] * level;
    intensity = intensity > bank.min_intensity[quad] ? intensity : bank.min_intensity[quad];
    intensity = intensity < bank.max_intensity[quad] ? intensity : bank.max_intensity[quad];
    store(__builtin_convertvector(intensity + 0.5F, Int4), stored);
  }
}

/// The first block of a pair holds the last return, the second the strongest; one echo for both is sent in both.
void PacketDecoder::merge_equal_returns() noexcept {
  for (std::size_t last = 0; last < kLanesPerBlock; ++last) {
    const std::size_t strongest = kLanesPerBlock + last;
    const bool same = points_.raw[last] == points_.raw[strongest];
    if (same) points_.raw[last] = 0;
    points_.kind[last] = ReturnKind::last;
    points_.kind[strongest] = same ? ReturnKind::both : ReturnKind::strongest;
  }
}

void PacketDecoder::emit(std::uint32_t group_time_ns, DecodedPacket& packet) const noexcept {
  Return* out = packet.returns.data() + packet.return_count;
  for (const Emission& emission : packet.dual_return ? dual_order_ : single_order_) {
    const std::size_t i = emission.point;
    // Written before it is known to be one: the next echo overwrites a blank, which is cheaper than a branch that
    // misses.
    const Float4 place = points_.place[i];
    *out = {.x_m = place[0],
            .y_m = place[1],
            .z_m = place[2],
            .azimuth_rad = place[3],
            .time_ns = group_time_ns + emission.time_ns,
            .laser = emission.laser,
            .intensity = static_cast<std::uint8_t>(points_.intensity[i]),
            .kind = packet.dual_return ? points_.kind[i] : ReturnKind::single};
    out += points_.raw[i] != 0 ? 1 : 0;
  }
  packet.return_count = static_cast<std::uint32_t>(out - packet.returns.data());
}

}  // namespace roadvec
