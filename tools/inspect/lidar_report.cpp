#include <cinttypes>

#include "drivers/velodyne/senders.h"
#include "tools/inspect/lidar_inspection.h"

namespace roadvec {
namespace {

std::string seen_text(const LidarInspection& i) {
  return i.seen_model ? std::string(model_text(*i.seen_model)) : "no model known here";
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

nlohmann::ordered_json status_json(const Hdl64Status& s) {
  nlohmann::ordered_json json;
  for (const auto& [name, value] : {std::pair{"year", s.year},
                                    {"month", s.month},
                                    {"day", s.day},
                                    {"hour", s.hour},
                                    {"minute", s.minute},
                                    {"second", s.second},
                                    {"temperature_degc", s.temperature_degc},
                                    {"firmware", s.firmware},
                                    {"warnings", s.warnings}}) {
    if (value) json[name] = *value;
  }
  if (s.gps) json["gps"] = s.follows_gps();
  json["table_heard"] = s.table().heard_share();
  json["table_complete"] = s.table().complete();
  return json;
}

void print_gps(const SensorClockReport& gps, std::FILE* out) {
  if (gps.position_packet_count == 0) {
    std::fprintf(out, "  gps            no position packets\n");
    return;
  }
  std::fprintf(out, "  gps            %" PRIu64 " position packets, pps %s, %" PRIu64 " sentences, %" PRIu64 " bad",
               gps.position_packet_count, name_of(gps.pps), gps.nmea_count, gps.nmea_bad_count);
  if (gps.fix) {
    std::fprintf(out, ", %s", gps.fix->valid ? "fix" : "no fix");
    if (gps.fix->place)
      std::fprintf(out, " at %.6f N %.6f E", gps.fix->place->latitude_deg, gps.fix->place->longitude_deg);
  }
  if (const auto utc = keeps_utc(gps)) std::fprintf(out, "; stamps are %sUTC", *utc ? "" : "not ");
  if (gps.device_after_nmea_ns)
    std::fprintf(out, " (%.3f s after the sentence)", static_cast<double>(*gps.device_after_nmea_ns) * 1e-9);
  if (gps.temperature_c) std::fprintf(out, "; %.0f C inside", *gps.temperature_c);
  std::fprintf(out, "\n");
}

void print_revolutions(const LidarInspection& i, std::FILE* out) {
  if (i.model.empty()) {
    std::fprintf(out, "  points         not decoded: %s\n", i.not_decoded.c_str());
    return;
  }
  std::fprintf(out, "  revolutions    %zu, %zu of them complete", i.sweeps, i.complete_sweeps);
  if (i.complete_sweeps > 0) {
    std::fprintf(out, "; %.2f per second; %zu to %zu points, median %zu", i.median_rate_hz, i.least_returns,
                 i.most_returns, i.median_returns);
  }
  std::fprintf(out, "\n  points         %" PRIu64 "\n", i.returns);
  std::fprintf(out, "  clock          the sensor's stamps are %.3f ms %s the host's clock (modulo an hour)",
               std::abs(static_cast<double>(i.stamps.device_minus_host_ns)) * 1e-6,
               i.stamps.device_minus_host_ns < 0 ? "behind" : "ahead of");
  if (i.stamps.last_step)
    std::fprintf(out, "; last step %+.3f s", static_cast<double>(i.stamps.last_step->size_ns) * 1e-9);
  std::fprintf(out, "\n");
}

}  // namespace

void print_text(const LidarInspection& i, std::FILE* out) {
  std::fprintf(out, "LiDAR %s\n", i.path.c_str());
  for (const auto& [traffic, count] : i.traffic) {
    std::fprintf(out, "  from %-15s %" PRIu64 " datagrams of %zu bytes to port %d\n",
                 ipv4_text(traffic.source_ipv4).c_str(), count, traffic.length, traffic.port);
  }
  if (i.other_frame_count > 0) std::fprintf(out, "  other frames   %" PRIu64 "\n", i.other_frame_count);
  std::fprintf(out, "  model          %s; by structure and pace: %s; by their own word: %s\n",
               i.model.empty() ? "not decoded" : ("decoded as " + i.model).c_str(), seen_text(i).c_str(),
               claimed_model(i.survey).c_str());
  std::fprintf(out, "  return mode    %s\n", return_mode(i.survey).c_str());
  std::fprintf(out, "  packets        %" PRIu64 " in %.3f s, %s; one takes %" PRId64 " us by the sensor's clock\n",
               i.counts.received, i.stream.duration_s(), i.stream.text().c_str(), i.survey.packet_period_us);
  print_revolutions(i, out);
  if (i.status) print_status(*i.status, out);
  if (!i.status) print_gps(i.gps, out);
  std::fprintf(out, "  counters\n");
  visit_counters(i.counts, [&](const char* name, std::uint64_t value) {
    std::fprintf(out, "    %-22s %" PRIu64 "\n", name, value);
  });
}

nlohmann::ordered_json json_of(const LidarInspection& i) {
  nlohmann::ordered_json json{{"path", i.path},
                              {"model", i.model},
                              {"seen_model", i.seen_model ? std::string(model_text(*i.seen_model)) : ""},
                              {"claimed_model", claimed_model(i.survey)},
                              {"return_mode", return_mode(i.survey)},
                              {"not_decoded", i.not_decoded},
                              {"packet_period_us", i.survey.packet_period_us},
                              {"stream", i.stream.json()},
                              {"other_frames", i.other_frame_count}};
  for (const auto& [traffic, count] : i.traffic) {
    json["traffic"].push_back({{"source", ipv4_text(traffic.source_ipv4)},
                               {"port", traffic.port},
                               {"bytes", traffic.length},
                               {"count", count}});
  }
  json["revolutions"] = i.sweeps;
  json["complete_revolutions"] = i.complete_sweeps;
  json["revolutions_per_s"] = i.median_rate_hz;
  json["points"] = i.returns;
  json["points_per_revolution"] = {{"least", i.least_returns}, {"median", i.median_returns}, {"most", i.most_returns}};
  nlohmann::ordered_json& clock = json["clock"];
  clock["device_minus_host_s"] = static_cast<double>(i.stamps.device_minus_host_ns) * 1e-9;
  if (i.stamps.last_step) clock["last_step_s"] = static_cast<double>(i.stamps.last_step->size_ns) * 1e-9;
  clock["pps"] = name_of(i.gps.pps);
  clock["position_packets"] = i.gps.position_packet_count;
  clock["nmea_sentences"] = i.gps.nmea_count;
  clock["nmea_bad"] = i.gps.nmea_bad_count;
  clock["fix"] = i.gps.fix && i.gps.fix->valid;
  if (const auto utc = keeps_utc(i.gps)) clock["stamps_are_utc"] = *utc;
  if (i.gps.device_after_nmea_ns)
    clock["device_after_nmea_s"] = static_cast<double>(*i.gps.device_after_nmea_ns) * 1e-9;
  if (i.gps.temperature_c) clock["sensor_temperature_degc"] = *i.gps.temperature_c;
  if (i.status) json["status"] = status_json(*i.status);
  visit_counters(i.counts, [&](const char* name, std::uint64_t value) { json["counters"][name] = value; });
  json["damaged"] = !i.damage.empty();
  return json;
}

}  // namespace roadvec
