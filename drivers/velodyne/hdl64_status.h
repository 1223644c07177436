#pragma once

#include <cstdint>
#include <optional>

#include "drivers/velodyne/streamed_calibration.h"

namespace roadvec {

/// What an HDL-64E says of itself in the last two bytes of its packets, type and value: nine of sixteen tell time and
/// health, seven carry the table of StreamedCalibration. Empty: not heard yet. [VelodyneHDL64ES3, app. E]
class Hdl64Status {
 public:
  /// Bits of `warnings`.
  static constexpr std::uint8_t kLensDirty = 0x01, kTooHot = 0x02, kTooCold = 0x04;
  static constexpr std::uint8_t kPpsPresent = 0x20, kGpsPresent = 0x40;

  /// `missing_before`: packets lost before this one; an estimate that is off by up to seven does no harm.
  void add(std::uint8_t type, std::uint8_t value, std::uint32_t missing_before) noexcept;

  using Value = std::optional<std::uint8_t>;
  Value hour, minute, second, day, month, year;  ///< UTC, if set by GPS; the year less 2000
  Value gps;                                     ///< 'P': the sensor's clock follows GPS
  Value temperature_degc, firmware;
  Value warnings;  ///< S3 alone

  [[nodiscard]] bool follows_gps() const { return gps == std::uint8_t{'P'}; }
  [[nodiscard]] const StreamedCalibration& table() const { return table_; }

 private:
  StreamedCalibration table_;
};

}  // namespace roadvec
