#include "drivers/velodyne/sensor_clock.h"

namespace roadvec {

const NmeaFix* SensorClock::add(const RawPositionPacket& raw) noexcept {
  const PositionPacket packet = parse_position_packet(raw);
  ++report_.position_packet_count;
  report_.pps = packet.pps;
  report_.temperature_c = packet.temperature_c;
  report_.thermal_shutdown = packet.thermal_shutdown;
  bool news = false;
  for (std::size_t at = packet.nmea.find('$'); at != std::string_view::npos; at = packet.nmea.find('$', at + 1)) {
    NmeaFix fix;
    const NmeaResult result = parse_nmea(packet.nmea.substr(at), fix);
    if (result == NmeaResult::other_sentence) continue;
    if (result != NmeaResult::fix) {
      ++report_.nmea_bad_count;
      continue;
    }
    ++report_.nmea_count;
    if (take(fix, raw.arrived, packet.device_time_us)) news = true;
  }
  return news ? &*report_.fix : nullptr;
}

/// False: the sentence was there already.
bool SensorClock::take(const NmeaFix& fix, SensorTime arrived, std::uint32_t device_time_us) noexcept {
  const auto& before = report_.fix;
  if (before && before->time_of_day_ns == fix.time_of_day_ns && before->valid == fix.valid &&
      before->utc.has_value() == fix.utc.has_value())
    return false;
  report_.fix = fix;
  report_.fix_arrived = arrived;
  report_.device_after_nmea_ns.reset();
  report_.host_after_nmea_ns.reset();
  if (fix.time_of_day_ns) {
    const std::int64_t device_ns = static_cast<std::int64_t>(device_time_us) * 1000;
    report_.device_after_nmea_ns = wrap_hour_ns(device_ns - *fix.time_of_day_ns % kHour_ns);
  }
  if (fix.utc) report_.host_after_nmea_ns = arrived - *fix.utc;
  return true;
}

std::optional<bool> keeps_utc(const SensorClockReport& report) noexcept {
  if (!report.fix || !report.fix->valid || !report.device_after_nmea_ns) return std::nullopt;
  return *report.device_after_nmea_ns >= 0 && *report.device_after_nmea_ns <= kLatestNmea_ns;
}

}  // namespace roadvec
