#include <cinttypes>
#include <cstdio>

#include "tools/roadvec/commands.h"
#include "tools/roadvec/json.h"

namespace roadvec {
namespace {

void print_stage(const wire::Stage& stage) {
  std::printf("\n%-12s %s\n", stage.name.c_str(), stage.state.c_str());
  for (const wire::Gauge& gauge : stage.gauges) std::printf("  %-34s %14.3f\n", gauge.name.c_str(), gauge.value);
  for (const wire::Counter& counter : stage.counters)
    std::printf("  %-34s %14" PRIu64 "\n", counter.name.c_str(), counter.value);
  if (stage.timings.empty()) return;
  std::printf("  %-34s %14s %10s %10s %10s\n", "step", "count", "p50 us", "p99 us", "max us");
  for (const wire::Timing& t : stage.timings) {
    std::printf("  %-34s %14" PRIu64 " %10.1f %10.1f %10.1f\n", t.step.c_str(), t.count, t.p50_us, t.p99_us, t.max_us);
  }
}

void print(const wire::Status& status) {
  const bool grows = status.not_growing_reason.empty();
  std::printf("roadvecd     %s, up %.0f s\n", status.server_version.c_str(), status.uptime_s);
  std::printf("state        %s%s%s\n", status.state.c_str(),
              grows ? "" : "; the map does not grow: ", status.not_growing_reason.c_str());
  std::printf("map          %.1f m in %" PRIu64 " lines, %" PRIu64 " tiles\n", status.map_length_m, status.line_count,
              status.tile_count);
  std::printf("drive        %.1f m, %" PRIu64 " keyframes, %" PRIu64 " loop closures\n", status.travelled_m,
              status.keyframe_count, status.loop_closure_count);
  std::printf("change       %" PRIu64 " (on disk: %" PRIu64 "), epoch %016" PRIx64 "\n", status.head_seq,
              status.durable_seq, status.epoch);
  for (const wire::Stage& stage : status.stages) print_stage(stage);
}

}  // namespace

int show_status(const Connection& connection) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  if (auto sent = client->send(wire::GetStatus{}); !sent) return complain(sent.error(), kExitFailure);
  const Expected<wire::Status> status = client->receive_one<wire::Status>(MapClient::Seconds(connection.timeout_s));
  if (!status) return complain(status.error(), kExitFailure);
  if (connection.json) {
    std::printf("%s\n", json_of(*status).c_str());
  } else {
    print(*status);
  }
  return kExitOk;
}

int show_metrics(const Connection& connection) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  if (auto sent = client->send(wire::GetMetrics{}); !sent) return complain(sent.error(), kExitFailure);
  const Expected<wire::Metrics> metrics = client->receive_one<wire::Metrics>(MapClient::Seconds(connection.timeout_s));
  if (!metrics) return complain(metrics.error(), kExitFailure);
  std::fputs(metrics->text.c_str(), stdout);
  return kExitOk;
}

}  // namespace roadvec
