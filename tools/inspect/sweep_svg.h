#pragma once

#include <string>
#include <vector>

#include "core/sensor/lidar.h"

namespace roadvec {

/// One sweep from above, 40 m around the sensor, coloured by height: a picture that shows at a glance whether model,
/// calibration and mounting are right.
[[nodiscard]] std::string svg_of_sweep(const std::vector<Return>& returns, const std::string& title);

}  // namespace roadvec
