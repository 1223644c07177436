#pragma once

#include <vector>

#include "tools/score/boundaries.h"
#include "tools/score/trajectory.h"

namespace roadvec {

/// Which samples of the truth a mapper can be asked for, one flag each: the sensor had returns from there within
/// `range_m`, and from somewhere on the way it is the first boundary in sight, seen from above: what lies behind
/// another boundary does not bound the road.
[[nodiscard]] std::vector<bool> visible(const std::vector<LineSample>& truth, const Boundaries& boundaries,
                                        const Trajectory& way, double range_m);

}  // namespace roadvec
