#pragma once

#include <string>

#include "tools/import/kitti_raw.h"

namespace roadvec {

/// For people: several lines.
[[nodiscard]] std::string text_of(const ImportReport& report, const std::string& out);
/// One JSON object, one line.
[[nodiscard]] std::string json_of(const ImportReport& report, const std::string& out);

}  // namespace roadvec
