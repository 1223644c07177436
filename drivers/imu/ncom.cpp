#include "drivers/imu/ncom.h"

#include <algorithm>
#include <cstring>

#include "core/base/angle.h"

namespace roadvec {
namespace {

using Packet = std::span<const std::uint8_t, kNcomPacketBytes>;

constexpr std::uint8_t kSync = 0xE7;
constexpr std::size_t kTimeOffset = 1, kAccelerationOffset = 3, kRateOffset = 12, kStatusOffset = 21,
                      kAnglesOffset = 52, kChannelOffset = 62, kChannelDataOffset = 63, kChecksumOffset = 71;
constexpr double kAccelerationStep_mps2 = 1e-4, kRateStep_radps = 1e-5, kAngleStep_rad = 1e-6;
constexpr std::int64_t kMinute_ms = 60'000;
constexpr std::uint8_t kInvalid = 0, kStatusOnly = 10, kFirstTrigger = 20, kLastTrigger = 22, kLocking = 3;

std::optional<double> i24(Packet packet, std::size_t at) {
  const auto bits = static_cast<std::int32_t>(packet[at] | packet[at + 1] << 8 | packet[at + 2] << 16);
  constexpr std::int32_t kNoValue = 0x800000;
  if (bits == kNoValue) return std::nullopt;
  return bits < kNoValue ? bits : bits - 2 * kNoValue;
}

std::optional<Eigen::Vector3d> vector(Packet packet, std::size_t at, double step) {
  const auto x = i24(packet, at), y = i24(packet, at + 3), z = i24(packet, at + 6);
  if (!x || !y || !z) return std::nullopt;
  return Eigen::Vector3d(*x, *y, *z) * step;
}

/// From axes with y right and z down, or a frame of north, east, down, to those with y left, z up; or east, north, up.
Eigen::Vector3d turned_up(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }

Eigen::Matrix3d R_enu_flu(const Eigen::Vector3d& heading_pitch_roll_rad) {
  Eigen::Matrix3d R_enu_ned;
  R_enu_ned << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  const Eigen::Matrix3d R_ned_frd =
      rotation_from(heading_pitch_roll_rad[2], heading_pitch_roll_rad[1], heading_pitch_roll_rad[0]);
  return R_enu_ned * R_ned_frd * Eigen::Vector3d(1, -1, -1).asDiagonal();
}

}  // namespace

NcomSample parse_ncom(Packet packet) noexcept {
  NcomSample sample;
  sample.time_ms = static_cast<std::uint16_t>(packet[kTimeOffset] | packet[kTimeOffset + 1] << 8);
  sample.navigation_status = packet[kStatusOffset];
  sample.acceleration_mps2 = vector(packet, kAccelerationOffset, kAccelerationStep_mps2);
  sample.rate_radps = vector(packet, kRateOffset, kRateStep_radps);
  // The filter's angles mean something once it navigates.
  if (sample.navigation_status >= kLocking) {
    sample.heading_pitch_roll_rad = vector(packet, kAnglesOffset, kAngleStep_rad);
  }
  if (packet[kChannelOffset] == 0) {
    std::uint32_t minutes = 0;
    for (std::size_t i = 4; i-- > 0;) minutes = minutes << 8 | packet[kChannelDataOffset + i];
    // A unit that has not seen the sky says 0 or less. The bound is the year 2170: nanoseconds must hold it.
    constexpr std::uint32_t kMostMinutes = 100'000'000;
    if (minutes > 0 && minutes < kMostMinutes) sample.minutes = static_cast<std::int32_t>(minutes);
  }
  return sample;
}

SensorTime utc_from_gps_ns(std::int64_t since_1980_ns) noexcept {
  // Seconds of GPS time at which GPS came to be 1, 2, ... 18 seconds ahead of UTC. [IERS bulletin C]
  constexpr auto kLeaps_s =
      std::to_array<std::int64_t>({46'828'801, 78'364'802, 109'900'803, 173'059'204, 252'028'805, 315'187'206,
                                   346'723'207, 393'984'008, 425'520'009, 457'056'010, 504'489'611, 551'750'412,
                                   599'184'013, 820'108'814, 914'803'215, 1'025'136'016, 1'119'744'017, 1'167'264'018});
  constexpr std::int64_t kGpsEpoch_s = 315'964'800, kSecond_ns = 1'000'000'000;
  const auto leap_count =
      std::upper_bound(kLeaps_s.begin(), kLeaps_s.end(), since_1980_ns / kSecond_ns) - kLeaps_s.begin();
  return {since_1980_ns + (kGpsEpoch_s - leap_count) * kSecond_ns};
}

std::optional<SensorTime> NcomClock::time_of(const NcomSample& sample) noexcept {
  if (sample.minutes) {
    last_ms_ = *sample.minutes * kMinute_ms + sample.time_ms;
  } else if (last_ms_) {
    const std::int64_t step_ms = (sample.time_ms - *last_ms_ % kMinute_ms + kMinute_ms) % kMinute_ms;
    *last_ms_ += step_ms < kMinute_ms / 2 ? step_ms : step_ms - kMinute_ms;
  } else {
    return std::nullopt;
  }
  return utc_from_gps_ns(*last_ms_ * 1'000'000);
}

/// Fills the buffer up to a packet with the right checksum; after a wrong one it looks one byte further on.
bool NcomDecoder::next_packet(std::span<const std::uint8_t>& bytes) noexcept {
  for (;;) {
    const std::size_t taken = std::min(bytes.size(), buffer_.size() - count_);
    std::copy_n(bytes.begin(), taken, buffer_.begin() + static_cast<std::ptrdiff_t>(count_));
    bytes = bytes.subspan(taken);
    count_ += taken;
    std::size_t drop = 0;
    if (count_ > 0 && buffer_[0] == kSync) {
      if (count_ < buffer_.size()) return false;
      unsigned sum = 0;
      for (std::size_t i = 1; i < kChecksumOffset; ++i) sum += buffer_[i];
      if ((sum & 0xFF) == buffer_[kChecksumOffset]) {
        count_ = 0;
        return true;
      }
      ++counters_.bad_checksum_count;
      drop = 1;
    }
    if (count_ == 0) return false;
    drop = static_cast<std::size_t>(std::find(buffer_.begin() + static_cast<std::ptrdiff_t>(drop),
                                              buffer_.begin() + static_cast<std::ptrdiff_t>(count_), kSync) -
                                    buffer_.begin());
    counters_.skipped_byte_count += drop;
    count_ -= drop;
    std::memmove(buffer_.data(), buffer_.data() + drop, count_);
  }
}

bool NcomDecoder::next(ImuBytes& bytes, MotionSample& sample) noexcept {
  while (next_packet(bytes.bytes)) {
    ++counters_.packet_count;
    last_ = parse_ncom(buffer_);
    const std::uint8_t status = last_.navigation_status;
    if (status == kStatusOnly || (status >= kFirstTrigger && status <= kLastTrigger)) {
      ++counters_.trigger_count;
      continue;
    }
    const std::optional<SensorTime> device_time = clock_.time_of(last_);
    SensorAxesSample axes;
    if (last_.rate_radps) axes.rate_radps = turned_up(*last_.rate_radps);
    if (last_.acceleration_mps2) axes.acceleration_mps2 = turned_up(*last_.acceleration_mps2);
    if (last_.heading_pitch_roll_rad) axes.R_enu_sensor = R_enu_flu(*last_.heading_pitch_roll_rad);
    const std::optional<ImuSample> imu = to_vehicle_.convert(axes);
    if (status == kInvalid || !imu) {
      ++counters_.not_ready_count;
      continue;
    }
    if (!bytes.has_time && !device_time) {
      ++untimed_count_;
      continue;
    }
    sample.time = bytes.has_time ? bytes.time : *device_time;
    sample.value = *imu;
    return true;
  }
  return false;
}

}  // namespace roadvec
