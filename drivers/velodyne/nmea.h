#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/time.h"

namespace roadvec {

/// What one RMC or GGA sentence of a GPS receiver says. [NMEA0183]
struct NmeaFix {
  struct Place {
    double latitude_deg = 0, longitude_deg = 0;  ///< WGS 84
  };
  bool valid = false;  ///< the receiver has a fix: RMC status 'A', GGA quality above 0
  std::optional<std::int64_t> time_of_day_ns;
  std::optional<SensorTime> utc;  ///< RMC alone tells the date
  std::optional<Place> place;
  std::optional<double> height_m;               ///< GGA: above the WGS 84 ellipsoid
  std::optional<double> speed_mps, course_deg;  ///< RMC: over ground; clockwise from north
};

enum class NmeaResult : std::uint8_t { fix, other_sentence, bad_checksum, malformed };

/// Reads the sentence that begins with '$'; what follows its checksum (CR LF, padding) does not matter. Takes any
/// bytes.
[[nodiscard]] NmeaResult parse_nmea(std::string_view sentence, NmeaFix& fix) noexcept;

}  // namespace roadvec
