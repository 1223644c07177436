#include "daemon/server/metrics.h"

#include <array>
#include <cmath>

#include "daemon/server/text_writer.h"

namespace roadvec {
namespace {

constexpr double kFirstBound_us = 1024;  // of Timing.at_most_counts

/// Names have letters, digits and underscores only.
std::string name_of(std::string_view text) {
  std::string name = "roadvec_";
  for (const char c : text) {
    const bool allowed = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    name += allowed ? c : '_';
  }
  return name;
}

std::string label_text(std::string_view text) {
  std::string label = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') label += '\\';
    if (c == '\n') {
      label += "\\n";
    } else {
      label += c;
    }
  }
  return label + "\"";
}

class Writer {
 public:
  void version(std::string_view value) {
    const std::string name = begin("build", "info");
    text_ += name + "_info{version=" + label_text(value) + "} 1\n";
  }
  void state(std::string_view value) {
    const std::string name = begin("state", "gauge");
    text_ += name + "{state=" + label_text(value) + "} 1\n";
  }
  void counter(std::string_view what, std::uint64_t value) {
    const std::string name = begin(what, "counter");
    text_ += name + "_total " + std::to_string(value) + "\n";
  }
  void gauge(std::string_view what, double value) {
    if (!std::isfinite(value)) return;
    const std::string name = begin(what, "gauge");
    text_ += name + " " + decimal(value, 6) + "\n";
  }
  /// Of a stage whose times have buckets [OpenMetrics 1.0, Histogram].
  void histograms(const std::string& stage, const std::vector<wire::Timing>& timings) {
    const std::string name = begin(stage + "_seconds", "histogram");
    for (const wire::Timing& timing : timings) {
      const std::string step = "step=" + label_text(timing.step);
      double bound_us = kFirstBound_us;
      for (const std::uint64_t count : timing.at_most_counts) {
        text_ +=
            name + "_bucket{" + step + ",le=\"" + decimal(bound_us * 1e-6, 6) + "\"} " + std::to_string(count) + "\n";
        bound_us *= 2;
      }
      text_ += name + "_bucket{" + step + ",le=\"+Inf\"} " + std::to_string(timing.count) + "\n";
      text_ += name + "_sum{" + step + "} " + seconds(timing.sum_us) + "\n";
      text_ += name + "_count{" + step + "} " + std::to_string(timing.count) + "\n";
    }
  }
  void health(const std::vector<wire::Stage>& stages) {
    if (stages.empty()) return;
    const std::string name = begin("stage_ok", "gauge");
    for (const wire::Stage& stage : stages)
      text_ += name + "{stage=" + label_text(stage.name) + "} " + (stage.state == "ok" ? "1" : "0") + "\n";
  }
  void timings(const std::string& stage, const std::vector<wire::Timing>& timings) {
    if (timings.empty()) return;
    if (!timings.front().at_most_counts.empty()) return histograms(stage, timings);
    const std::string name = begin(stage + "_step_seconds", "summary");
    for (const wire::Timing& timing : timings) {
      const std::string step = "step=" + label_text(timing.step);
      text_ += name + "{" + step + ",quantile=\"0.5\"} " + seconds(timing.p50_us) + "\n";
      text_ += name + "{" + step + ",quantile=\"0.99\"} " + seconds(timing.p99_us) + "\n";
      text_ += name + "_sum{" + step + "} " + seconds(timing.sum_us) + "\n";
      text_ += name + "_count{" + step + "} " + std::to_string(timing.count) + "\n";
    }
    const std::string longest = begin(stage + "_step_longest_seconds", "gauge");
    for (const wire::Timing& timing : timings)
      text_ += longest + "{step=" + label_text(timing.step) + "} " + seconds(timing.max_us) + "\n";
  }
  [[nodiscard]] std::string done() { return text_ + "# EOF\n"; }

 private:
  std::string begin(std::string_view what, const char* type) {
    std::string name = name_of(what);
    text_ += "# TYPE " + name + " " + type + "\n";
    return name;
  }
  static std::string seconds(double us) { return decimal(us * 1e-6, 9); }

  std::string text_;
};

void write(const wire::Stage& stage, Writer& out) {
  for (const wire::Counter& counter : stage.counters) out.counter(stage.name + "_" + counter.name, counter.value);
  for (const wire::Gauge& gauge : stage.gauges) out.gauge(stage.name + "_" + gauge.name, gauge.value);
  out.timings(stage.name, stage.timings);
}

}  // namespace

std::string open_metrics_of(const wire::Status& status) {
  Writer out;
  out.version(status.server_version);
  out.state(status.state);
  out.gauge("map_grows", status.not_growing_reason.empty() ? 1 : 0);
  out.counter("map_changes", status.head_seq);
  out.counter("map_durable_changes", status.durable_seq);
  out.counter("keyframes", status.keyframe_count);
  out.counter("loop_closures", status.loop_closure_count);
  out.gauge("map_lines", static_cast<double>(status.line_count));
  out.gauge("map_tiles", static_cast<double>(status.tile_count));
  out.gauge("map_length_meters", status.map_length_m);
  out.gauge("travelled_meters", status.travelled_m);
  out.gauge("uptime_seconds", status.uptime_s);
  out.health(status.stages);
  for (const wire::Stage& stage : status.stages) write(stage, out);
  return out.done();
}

}  // namespace roadvec
