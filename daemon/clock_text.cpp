#include "daemon/clock_text.h"

#include <fmt/format.h>

#include <cmath>

namespace roadvec {
namespace {

const char* name_of(LidarClock clock) {
  switch (clock) {
    case LidarClock::arrival:
      return "arrival";
    case LidarClock::device:
      return "device";
    case LidarClock::device_utc:
      return "device_utc";
  }
  return "arrival";
}

std::string time_of_day(std::int64_t ns) {
  const std::int64_t s = ns / 1'000'000'000 % 86'400;
  return fmt::format("{:02}:{:02}:{:02} UTC", s / 3600, s / 60 % 60, s % 60);
}

std::string duration(std::int64_t ns) {
  const double s = std::abs(static_cast<double>(ns) * 1e-9);
  return s < 1 ? fmt::format("{:.2f} ms", s * 1e3) : fmt::format("{:.3f} s", s);
}

std::string gps_text(const SensorClockReport& gps) {
  if (gps.position_packet_count == 0) return ", no position packets";
  std::string text = fmt::format(", pps {}", name_of(gps.pps));
  if (!gps.fix) return text + ", no nmea";
  text += ", nmea";
  if (gps.fix->time_of_day_ns) text += " " + time_of_day(*gps.fix->time_of_day_ns);
  return text + (gps.fix->valid ? " valid" : " without fix");
}

std::string utc_text(LidarClock clock, const SensorClockReport& gps) {
  const std::optional<bool> utc = keeps_utc(gps);
  if (utc) return *utc ? ", stamps are UTC" : ", stamps are not UTC";
  // Nothing says so; with this setting someone counts on it.
  return clock == LidarClock::device_utc ? ", not known to keep UTC" : "";
}

}  // namespace

std::string clock_text(LidarClock clock, const LidarClockReport& report) {
  const PacketClockState& stamps = report.stamps;
  std::string text = name_of(clock) + gps_text(report.gps) + utc_text(clock, report.gps);
  if (report.gps.thermal_shutdown) text += ", too hot: the sensor does not fire";
  text += fmt::format(", {} {} the host", duration(stamps.device_minus_host_ns),
                      stamps.device_minus_host_ns < 0 ? "behind" : "ahead of");
  if (!stamps.last_step) return text + ", never stepped";
  return text + fmt::format(", stepped {} {} at {}", duration(stamps.last_step->size_ns),
                            stamps.last_step->size_ns < 0 ? "back" : "ahead", time_of_day(stamps.last_step->time.ns));
}

}  // namespace roadvec
