#include "tools/inspect/inspection.h"

#include <algorithm>
#include <cinttypes>

namespace roadvec {
namespace {

template <class T>
T median(std::vector<T> values) {
  if (values.empty()) return {};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

std::int64_t delay_ns(const RawPacket& packet) {
  const std::int64_t ns =
      (packet.arrived.ns - static_cast<std::int64_t>(device_time_us(packet.bytes)) * 1000) % kHour_ns;
  return (ns + kHour_ns) % kHour_ns;
}

std::string text_of(const Hdl64Status::Value& value) { return value ? std::to_string(*value) : "-"; }

/// What the head says of itself; - where the recording is too short to have heard it.
void print_status(const Hdl64Status& s, std::FILE* out) {
  std::fprintf(out,
               "  the head says  %s-%s-%s %s:%s:%s (year-month-day UTC), %s, %s degrees C, firmware %s, warnings %s\n",
               text_of(s.year).c_str(), text_of(s.month).c_str(), text_of(s.day).c_str(), text_of(s.hour).c_str(),
               text_of(s.minute).c_str(), text_of(s.second).c_str(),
               s.gps ? s.follows_gps() ? "set by GPS" : "not set by GPS" : "GPS -", text_of(s.temperature_degc).c_str(),
               text_of(s.firmware).c_str(), text_of(s.warnings).c_str());
  const StreamedCalibration& table = s.table();
  if (!table.complete()) {
    std::fprintf(out, "  its own table  %.0f %% heard, refused %" PRIu64 " times\n", table.heard_share() * 100,
                 table.refused_count());
    return;
  }
  constexpr const char* kReturns[] = {"strongest", "last", "both"};
  std::fprintf(out, "  its own table  complete; returns %s, power level %X\n",
               table.returns() ? kReturns[static_cast<std::size_t>(*table.returns())] : "unknown", table.power_level());
}

void print_status_json(const Hdl64Status& s, std::FILE* out) {
  const auto value = [](const Hdl64Status::Value& v) { return v ? std::to_string(*v) : std::string("null"); };
  std::fprintf(out,
               " \"status\": {\"year\": %s, \"month\": %s, \"day\": %s, \"hour\": %s, \"minute\": %s, \"second\": %s, "
               "\"gps\": %s, \"temperature_degc\": %s, \"firmware\": %s, \"warnings\": %s, \"table_heard\": %.4f, "
               "\"table_complete\": %s},\n",
               value(s.year).c_str(), value(s.month).c_str(), value(s.day).c_str(), value(s.hour).c_str(),
               value(s.minute).c_str(), value(s.second).c_str(),
               !s.gps            ? "null"
               : s.follows_gps() ? "true"
                                 : "false",
               value(s.temperature_degc).c_str(), value(s.firmware).c_str(), value(s.warnings).c_str(),
               s.table().heard_share(), s.table().complete() ? "true" : "false");
}

const char* return_mode(const Inspection& inspection) { return inspection.survey.dual_return ? "dual" : "single"; }

}  // namespace

SweepRecorder::SweepRecorder(LidarModel model, std::FILE* points) : points_(points) {
  slot_.returns.reserve(max_returns_per_sweep(model));
  if (points_ != nullptr) std::fputs("sweep,x_m,y_m,z_m,intensity,t_ns,laser,return\n", points_);
}

void SweepRecorder::publish() noexcept {
  ++sweep_count;
  return_count += slot_.returns.size();
  if (slot_.complete) {
    return_counts.push_back(slot_.returns.size());
    rates_hz.push_back(1.0 / std::max(seconds_between(slot_.start, slot_.end), 1e-3));
  }
  if (points_ == nullptr) return;
  for (const Return& r : slot_.returns) {
    std::fprintf(points_, "%" PRIu64 ",%.4f,%.4f,%.4f,%d,%" PRId64 ",%d,%d\n", slot_.index, static_cast<double>(r.x_m),
                 static_cast<double>(r.y_m), static_cast<double>(r.z_m), r.intensity, slot_.start.ns + r.time_ns,
                 r.laser, static_cast<int>(r.kind));
  }
}

Inspection inspect(PcapReader& reader, const std::string& path, const Survey& survey, LidarModel model,
                   const Calibration& calibration, LidarCounters& counters, std::FILE* points, bool progress) {
  Inspection result;
  result.path = path;
  result.model = model;
  result.survey = survey;
  SweepRecorder recorder(model, points);
  SweepDecoder driver(model, calibration, {}, recorder, counters);
  std::span<const RawPacket> batch;
  ReadResult read = ReadResult::packets;
  std::uint64_t packet_count = 0;
  while ((read = reader.read(batch, {})) == ReadResult::packets) {
    for (const RawPacket& packet : batch) {
      const std::int64_t delay = delay_ns(packet);
      if (packet_count++ == 0) {
        result.first_arrived = packet.arrived;
        result.least_delay_ns = result.most_delay_ns = delay;
      }
      result.last_arrived = packet.arrived;
      result.least_delay_ns = std::min(result.least_delay_ns, delay);
      result.most_delay_ns = std::max(result.most_delay_ns, delay);
      driver.add(packet);
      if (progress && packet_count % 20'000 == 0)
        std::fprintf(stderr, "\r%" PRIu64 " packets, %zu sweeps", packet_count, recorder.sweep_count);
    }
  }
  driver.finish();
  if (progress && packet_count >= 20'000) std::fputs("\r\033[K", stderr);
  if (read == ReadResult::failed) result.damage = reader.error();
  result.counts = snapshot(counters);
  result.position_packets = reader.position_packet_count();
  result.fragments = reader.fragment_count();
  result.other_frames = reader.other_frame_count();
  result.status = driver.status();
  result.other_product_id = driver.decoder().other_product_id_count();
  result.sweeps = recorder.sweep_count;
  result.complete_sweeps = recorder.return_counts.size();
  result.returns = recorder.return_count;
  if (!recorder.return_counts.empty()) {
    result.least_returns = std::ranges::min(recorder.return_counts);
    result.most_returns = std::ranges::max(recorder.return_counts);
    result.median_returns = median(recorder.return_counts);
    result.median_rate_hz = median(recorder.rates_hz);
  }
  return result;
}

void print_text(const Inspection& i, std::FILE* out) {
  const ModelFacts& facts = facts_of(i.model);
  const double seconds = i.duration_s();
  std::fprintf(out, "%s\n", i.path.c_str());
  std::fprintf(out, "  model          %s, packets claim %s\n", std::string(facts.name).c_str(),
               claimed_model(i.survey).c_str());
  if (i.other_product_id > 0) {
    std::fprintf(out, "                 (the configured model rules: old firmware sends another model's id)\n");
  }
  std::fprintf(out, "  return mode    %s\n", return_mode(i));
  std::fprintf(out, "  packets        %" PRIu64 " in %.3f s", i.counts.received, seconds);
  if (seconds > 0) std::fprintf(out, ", %.1f per second", static_cast<double>(i.counts.received - 1) / seconds);
  std::fprintf(out, "; one takes %" PRId64 " us by the sensor's clock\n", i.survey.packet_period_us);
  std::fprintf(out,
               "  other traffic  %" PRIu64 " position packets, %" PRIu64 " IP fragments, %" PRIu64 " other frames\n",
               i.position_packets, i.fragments, i.other_frames);
  std::fprintf(out, "  revolutions    %zu, %zu of them complete", i.sweeps, i.complete_sweeps);
  if (i.complete_sweeps > 0) {
    std::fprintf(out, "; %.2f per second; %zu to %zu points, median %zu", i.median_rate_hz, i.least_returns,
                 i.most_returns, i.median_returns);
  }
  std::fprintf(out, "\n  points         %" PRIu64 "\n", i.returns);
  std::fprintf(out, "  clock          arrival is %.3f to %.3f ms after the sensor's stamp (modulo an hour)\n",
               static_cast<double>(i.least_delay_ns) * 1e-6, static_cast<double>(i.most_delay_ns) * 1e-6);
  if (!facts.has_return_mode) print_status(i.status, out);
  std::fprintf(out, "  counters\n");
  visit_counters(i.counts, [&](const char* name, std::uint64_t value) {
    std::fprintf(out, "    %-17s %" PRIu64 "\n", name, value);
  });
}

void print_json(const Inspection& i, std::FILE* out) {
  const ModelFacts& facts = facts_of(i.model);
  std::string path;
  for (const char c : i.path) {
    if (c == '"' || c == '\\') path += '\\';
    if (static_cast<unsigned char>(c) >= 0x20) path += c;
  }
  std::fprintf(out, "{\"path\": \"%s\", \"model\": \"%s\", \"claimed_model\": \"%s\", \"return_mode\": \"%s\",\n",
               path.c_str(), std::string(facts.name).c_str(), claimed_model(i.survey).c_str(), return_mode(i));
  std::fprintf(out, " \"duration_s\": %.6f, \"packet_period_us\": %" PRId64 ", \"position_packets\": %" PRIu64,
               i.duration_s(), i.survey.packet_period_us, i.position_packets);
  std::fprintf(out, ", \"fragments\": %" PRIu64 ", \"other_frames\": %" PRIu64 ",\n", i.fragments, i.other_frames);
  std::fprintf(out,
               " \"revolutions\": %zu, \"complete_revolutions\": %zu, \"revolutions_per_s\": %.4f, \"points\": %" PRIu64
               ",\n",
               i.sweeps, i.complete_sweeps, i.median_rate_hz, i.returns);
  std::fprintf(out, " \"points_per_revolution\": {\"least\": %zu, \"median\": %zu, \"most\": %zu},\n", i.least_returns,
               i.median_returns, i.most_returns);
  std::fprintf(out, " \"arrival_after_stamp_ns\": {\"least\": %" PRId64 ", \"most\": %" PRId64 "},\n \"counters\": {",
               i.least_delay_ns, i.most_delay_ns);
  const char* separator = "";
  visit_counters(i.counts, [&](const char* name, std::uint64_t value) {
    std::fprintf(out, "%s\"%s\": %" PRIu64, separator, name, value);
    separator = ", ";
  });
  std::fputs("},\n", out);
  if (!facts.has_return_mode) print_status_json(i.status, out);
  std::fprintf(out, " \"damaged\": %s}\n", i.damage.empty() ? "false" : "true");
}

}  // namespace roadvec
