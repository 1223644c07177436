#include "drivers/velodyne/streamed_calibration.h"

#include <algorithm>
#include <string_view>

#include "core/base/angle.h"
#include "drivers/velodyne/calibration_text.h"

namespace roadvec {
namespace {

/// One cycle of packets: nine of time and health, seven of the table. An S3 sends its warnings as the first of every
/// fourth seven.
constexpr std::string_view kTypes = "HMSDNYGTV1234567";
constexpr int kFirstByteSlot = 9;
constexpr std::string_view kMarker = "UNIT#";
constexpr int kLaserBytes = 21;
/// So many lasers must be found at their places before the begin of the table is believed.
constexpr int kLeastFound = 4;
constexpr int kCyclesBetweenTries = 65;
constexpr std::uint8_t kMostVotes = 3;
constexpr std::uint8_t kCorrectsIntensity = 0xA8;

int slot_of(std::uint8_t type) noexcept {
  if (type == 'W') return kFirstByteSlot;
  const std::size_t slot = kTypes.find(static_cast<char>(type));
  return slot == std::string_view::npos ? -1 : static_cast<int>(slot);
}

}  // namespace

StreamedCalibration::StreamedCalibration() { calibration_.lasers.resize(kLaserCount); }

void StreamedCalibration::add(std::uint8_t type, std::uint8_t value, std::uint32_t missing_before) noexcept {
  if (complete_) return;
  passed_count_ += missing_before;
  const int slot = slot_of(type);
  if (slot < 0) {
    ++passed_count_;
    return;
  }
  // The count of missing packets is an estimate; the type says which slot of the cycle this is, so take the nearest.
  const std::int64_t guess = position_ < 0 ? slot : position_ + passed_count_ + 1;
  const std::int64_t off = ((slot - guess) % kCyclePackets + kCyclePackets + kCyclePackets / 2) % kCyclePackets;
  position_ = (guess + off - kCyclePackets / 2 + kTablePackets) % kTablePackets;
  passed_count_ = 0;
  if (slot < kFirstByteSlot) return;
  const auto cycle = static_cast<int>(position_ / kCyclePackets);
  vote(bytes_[static_cast<std::size_t>(cycle * kCycleBytes + slot - kFirstByteSlot)], value);
  if (slot == kCyclePackets - 1 && heard_count_ == kTableBytes && --cycles_to_next_try_ <= 0) try_to_complete();
}

/// A value heard once gives way to the next; one heard often holds out against a few others.
void StreamedCalibration::vote(Vote& place, std::uint8_t value) noexcept {
  if (place.votes == 0) ++heard_count_;
  if (place.votes == 0 || (place.votes == 1 && place.value != value)) {
    place = {value, 1};
  } else if (place.value == value) {
    place.votes = std::min<std::uint8_t>(place.votes + 1, kMostVotes);
  } else {
    --place.votes;
  }
}

/// Where most lasers' numbers stand in their places, and none stands wrong.
std::optional<int> StreamedCalibration::find_start() const noexcept {
  std::optional<int> maybe_start;
  int most = kLeastFound - 1;
  for (int start = 0; start < kTableBytes; start += kCycleBytes) {
    int found = 0;
    for (int number = 0; number < kLaserCount; ++number) {
      const Vote& id = at(start, laser_byte(number));
      if (id.votes != 0) found += id.value == number ? 1 : -1;
    }
    if (found > most) {
      most = found;
      maybe_start = start;
    }
  }
  return maybe_start;
}

std::optional<LaserCalibration> StreamedCalibration::laser(int number) const noexcept {
  const std::optional<int> maybe_start = complete_ ? start_ : find_start();
  if (!maybe_start) return std::nullopt;
  for (int byte = 0; byte < kLaserBytes; ++byte) {
    if (at(*maybe_start, laser_byte(number) + byte).votes == 0) return std::nullopt;
  }
  return decode_laser(*maybe_start, number);
}

LaserCalibration StreamedCalibration::decode_laser(int start, int number) const noexcept {
  const auto field = [&](int byte) {
    return static_cast<double>(static_cast<std::int16_t>(u16_at(start, laser_byte(number) + byte)));
  };
  const auto level = [&](int byte) { return static_cast<double>(at(start, laser_byte(number) + byte).value); };
  return {.rotation_rad = rad_from_deg(field(3) / 100),
          .elevation_rad = rad_from_deg(field(1) / 100),
          .distance_m = field(5) / 1000,
          .distance_x_m = field(7) / 1000,
          .distance_y_m = field(9) / 1000,
          .vertical_offset_m = field(11) / 1000,
          .horizontal_offset_m = field(13) / 1000,
          .focal_distance_m = field(15) / 1000,
          .focal_slope = field(17) / 10,
          .min_intensity = level(19),
          .max_intensity = level(20)};
}

std::optional<StreamedCalibration::Returns> StreamedCalibration::returns() const {
  const std::uint8_t value = at(start_, kReturnsByte).value;
  if (value > static_cast<std::uint8_t>(Returns::both)) return std::nullopt;
  return static_cast<Returns>(value);
}

void StreamedCalibration::try_to_complete() noexcept {
  cycles_to_next_try_ = kCyclesBetweenTries;
  const std::optional<int> maybe_start = find_start();
  if (!maybe_start || !is_right(*maybe_start)) {
    ++refused_count_;
    return;
  }
  start_ = *maybe_start;
  for (int number = 0; number < kLaserCount; ++number) {
    LaserCalibration& laser = calibration_.lasers[static_cast<std::size_t>(number)];
    laser = decode_laser(start_, number);
    if (power_level() == kCorrectsIntensity) laser.focal_slope = 0, laser.min_intensity = 0, laser.max_intensity = 255;
  }
  complete_ = true;
}

bool StreamedCalibration::is_right(int start) const noexcept {
  for (std::size_t i = 0; i < kMarker.size(); ++i) {
    if (at(start, static_cast<int>(i)).value != static_cast<std::uint8_t>(kMarker[i])) return false;
  }
  for (int number = 0; number < kLaserCount; ++number) {
    if (at(start, laser_byte(number)).value != number) return false;
    if (implausible(decode_laser(start, number)) != nullptr) return false;
  }
  const std::uint16_t trailer = u16_at(start, kTableBytes - 2);
  return trailer == crc(start) || (trailer == kTableBytes && all_heard_twice(start));
}

bool StreamedCalibration::all_heard_twice(int start) const noexcept {
  for (int number = 0; number < kLaserCount; ++number) {
    for (int byte = 0; byte < kLaserBytes; ++byte) {
      if (at(start, laser_byte(number) + byte).votes < 2) return false;
    }
  }
  return true;
}

/// CRC-16 by the polynomial 0x8005, from 0, not reflected, over all that follows the lasers' numbers.
std::uint16_t StreamedCalibration::crc(int start) const noexcept {
  std::uint32_t remainder = 0;
  for (int number = 0; number < kLaserCount; ++number) {
    for (int byte = 1; byte < kLaserBytes; ++byte) {
      remainder ^= static_cast<std::uint32_t>(at(start, laser_byte(number) + byte).value) << 8;
      for (int bit = 0; bit < 8; ++bit) {
        remainder = remainder << 1 ^ ((remainder & 0x8000) != 0 ? 0x8005U : 0U);
      }
    }
  }
  return static_cast<std::uint16_t>(remainder);
}

}  // namespace roadvec
