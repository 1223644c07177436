#pragma once

#include "daemon/config/settings.h"

namespace roadvec {

/// Sets up spdlog's default logger: the journal when journald reads our standard error, else the terminal. Ordinary
/// threads alone log; real-time threads count.
void set_up_log(const LogSettings& settings);
/// From now on; any thread may.
void set_log_level(LogLevel level);

}  // namespace roadvec
