#pragma once

#include <string>

#include "core/wire/messages.h"

namespace roadvec {

/// The status as OpenMetrics text, as Prometheus and its like read it [OpenMetrics 1.0]:
/// roadvec_<stage>_<counter>_total, roadvec_<stage>_<gauge>, roadvec_<stage>_step_seconds{step="...",quantile="0.5"},
/// the histogram roadvec_latency_seconds{step="...",le="..."}, roadvec_stage_ok{stage="..."}. The same status gives the
/// same bytes. The words of the stages' states are left out: each would begin another time series.
[[nodiscard]] std::string open_metrics_of(const wire::Status& status);

}  // namespace roadvec
