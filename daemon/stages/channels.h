#pragma once

#include "core/pipeline/keyframe.h"
#include "core/sensor/lidar.h"
#include "core/sensor/motion.h"
#include "daemon/stages/channel.h"

namespace roadvec {

using SweepChannel =
    Channel<Sweep, 8>;  ///< lidar -> mapping: 0.8 s at 10 Hz; full: the newest sweep is refused, counted
using MotionChannel =
    Channel<MotionSample, 4096>;  ///< vehicle -> mapping: 4 s at 1 kHz; full: the newest sample is refused
using KeyframeChannel =
    Channel<Keyframe, 64>;  ///< mapping -> optimiser: 128 m of road; full: the keyframe waits a sweep

}  // namespace roadvec
