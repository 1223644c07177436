#pragma once

#include <string>

#include "tools/replay/player.h"

namespace roadvec {

[[nodiscard]] std::string plan_text(const std::string& drive, const PlayPlan& plan, const Player::Tracks& tracks);
[[nodiscard]] std::string progress_text(const PlayReport& report, const Player::Tracks& tracks);
[[nodiscard]] std::string report_text(const PlayReport& report, const Player::Tracks& tracks);
[[nodiscard]] std::string report_json(const std::string& drive, const PlayPlan& plan, const PlayReport& report,
                                      const Player::Tracks& tracks);

}  // namespace roadvec
