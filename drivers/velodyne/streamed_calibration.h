#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "drivers/velodyne/calibration.h"

namespace roadvec {

/// Collects the calibration that an HDL-64E sends over and over, a byte in 7 of 16 packets: 260 cycles, 1.4 s and less.
///
/// Each byte is placed by its type and by how many packets went missing since the last; rounds vote, so lost, doubled
/// and misplaced bytes do no lasting harm. Where the table begins is found by the laser numbers in it. An S3's table is
/// taken when its CRC is right; an S2's trailer is but its length, so each of its bytes must have come twice alike.
/// [VelodyneHDL64ES3, app. E] [velodyne_decoder]. Pure; after the constructor it neither allocates nor throws.
class StreamedCalibration {
 public:
  static constexpr int kLaserCount = 64;
  enum class Returns : std::uint8_t { strongest, last, both };

  StreamedCalibration();

  /// The status type and value of the next packet, and how many are missing before it.
  void add(std::uint8_t type, std::uint8_t value, std::uint32_t missing_before) noexcept;

  [[nodiscard]] bool complete() const { return complete_; }
  /// When complete(). A head that corrects intensity by itself (power level A8) leaves nothing to correct there.
  [[nodiscard]] const Calibration& calibration() const { return calibration_; }
  /// What the sensor is set to send; when complete().
  [[nodiscard]] std::optional<Returns> returns() const;
  [[nodiscard]] std::uint8_t power_level() const { return at(start_, kPowerLevelByte).value; }

  /// One laser as far as heard, not yet checked. Empty: bytes are missing, or it is not yet known where the table
  /// begins.
  [[nodiscard]] std::optional<LaserCalibration> laser(int number) const noexcept;
  /// Of the table's bytes, whether right or not.
  [[nodiscard]] double heard_share() const { return static_cast<double>(heard_count_) / kTableBytes; }
  /// Whole tables that were refused: a wrong CRC, or an S2's that was heard once.
  [[nodiscard]] std::uint64_t refused_count() const { return refused_count_; }

 private:
  static constexpr int kCyclePackets = 16, kCycleBytes = 7, kCycleCount = 260;
  static constexpr int kTableBytes = kCycleBytes * kCycleCount, kTablePackets = kCyclePackets * kCycleCount;
  static constexpr int kLaserStride = 4 * kCycleBytes;
  static constexpr int kReturnsByte = kTableBytes - 5, kPowerLevelByte = kTableBytes - 3;
  struct Vote {
    std::uint8_t value = 0, votes = 0;  ///< no votes: not heard
  };

  /// Byte `byte` of the table, if it begins at `start`.
  [[nodiscard]] const Vote& at(int start, int byte) const noexcept {
    return bytes_[static_cast<std::size_t>((start + byte) % kTableBytes)];
  }
  [[nodiscard]] std::uint16_t u16_at(int start, int byte) const noexcept {
    return static_cast<std::uint16_t>(at(start, byte).value | at(start, byte + 1).value << 8);
  }
  static constexpr int laser_byte(int number) { return kCycleBytes + number * kLaserStride; }

  void vote(Vote& place, std::uint8_t value) noexcept;
  [[nodiscard]] std::optional<int> find_start() const noexcept;
  [[nodiscard]] LaserCalibration decode_laser(int start, int number) const noexcept;
  void try_to_complete() noexcept;
  [[nodiscard]] bool is_right(int start) const noexcept;
  [[nodiscard]] bool all_heard_twice(int start) const noexcept;
  [[nodiscard]] std::uint16_t crc(int start) const noexcept;

  std::array<Vote, kTableBytes> bytes_{};  ///< the ring of the table, from wherever we came in
  int heard_count_ = 0;
  std::int64_t position_ = -1;      ///< in packets, of the last byte placed; below 0: none yet
  std::uint32_t passed_count_ = 0;  ///< packets of unknown type since
  int cycles_to_next_try_ = 0;
  std::uint64_t refused_count_ = 0;
  bool complete_ = false;
  int start_ = 0;  ///< when complete
  Calibration calibration_;
};

}  // namespace roadvec
