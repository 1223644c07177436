#pragma once

#include "core/base/error.h"
#include "daemon/config/settings.h"
#include "daemon/sensors.h"
#include "daemon/service.h"

namespace roadvec {

/// The start fix where the configuration has none: from the GPS receiver at the LiDAR, as soon as it has a fix and the
/// vehicle drives. Packets that come until then are read and let go, so that the first sweep lies at the fix. Live, it
/// waits as long as it takes, and fails on SIGINT or SIGTERM.
[[nodiscard]] Expected<AnchorSettings> anchor_from_gps(LidarInput& lidar, InputKind kind, const Service& service);

}  // namespace roadvec
