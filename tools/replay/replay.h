#pragma once

#include <optional>
#include <string>

#include "core/base/error.h"
#include "tools/replay/output.h"
#include "tools/replay/player.h"

namespace roadvec {

struct ReplayOptions {
  std::string drive;
  PlayPlan plan;
  Endpoint udp{"127.0.0.1", 2368};
  int position_port = 8308;  ///< 0: position packets stay unsent
  std::string can, can_pipe, imu_pty;
  std::optional<Endpoint> imu_udp;
  bool json = false;
};

/// Plays the drive to its end or to a signal, and prints the report. Returns the exit status.
[[nodiscard]] int replay(const ReplayOptions& options);

}  // namespace roadvec
