#pragma once

#include <string>

#include "drivers/velodyne/calibration.h"

namespace roadvec {

/// The calibration as Velodyne writes it, in degrees and centimetres.
[[nodiscard]] std::string db_xml(const Calibration& calibration);

}  // namespace roadvec
