#pragma once

#include <string>

#include "daemon/config/settings.h"
#include "daemon/stages/lidar_stage.h"

namespace roadvec {

/// The sensor's clock for a person, in one line: "device_utc, pps locked, nmea 13:02:11 UTC valid, stamps are UTC, 0.3
/// ms behind the host, never stepped".
[[nodiscard]] std::string clock_text(LidarClock clock, const LidarClockReport& report);

}  // namespace roadvec
