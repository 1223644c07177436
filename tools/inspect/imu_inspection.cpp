#include "tools/inspect/imu_inspection.h"

#include <cinttypes>
#include <cmath>

#include "drivers/imu/log_reader.h"
#include "drivers/imu/ncom.h"
#include "drivers/imu/xsens.h"

namespace roadvec {
namespace {

void note_decoder(const XsensDecoder& decoder, ImuInspection& result) {
  const XsensCounters& counters = decoder.counters();
  result.bad_checksum_count = counters.bad_checksum_count;
  result.skipped_byte_count = counters.skipped_byte_count;
  result.lost_message_count = counters.lost_message_count;
  const XsensSample& last = decoder.last();
  if (counters.device_error_count > 0)
    result.notes.push_back(std::to_string(counters.device_error_count) + " error messages of the device");
  if (last.temperature_c) result.notes.push_back("temperature " + std::to_string(last.temperature_c->front()) + " C");
  if (last.latitude_longitude_deg) result.notes.emplace_back("sends its position");
  if (last.utc) result.notes.emplace_back(last.utc->flags != 0 ? "sends UTC" : "sends UTC, not valid yet");
  if (!last.has_time_fine) result.notes.emplace_back("sends no sample time: a recording without stamps is lost");
  if (!last.has_packet_counter) result.notes.emplace_back("sends no packet counter: losses cannot be counted");
}

void note_decoder(const NcomDecoder& decoder, ImuInspection& result) {
  const NcomCounters& counters = decoder.counters();
  result.bad_checksum_count = counters.bad_checksum_count;
  result.skipped_byte_count = counters.skipped_byte_count;
  if (counters.packet_count == 0) return;
  result.notes.push_back("navigation status " + std::to_string(decoder.last().navigation_status) +
                         (decoder.last().navigation_status == 4 ? " (locked)" : ""));
  if (counters.trigger_count > 0)
    result.notes.push_back(std::to_string(counters.trigger_count) + " trigger and status packets");
  if (counters.not_ready_count > 0)
    result.notes.push_back(std::to_string(counters.not_ready_count) + " packets of a unit that was not ready");
}

template <class Decoder>
Expected<ImuInspection> decode_all(const std::string& path, const std::string& protocol) {
  auto reader = open_imu_recording(path);
  if (!reader) return tl::unexpected(reader.error());
  ImuInspection result;
  result.path = path;
  result.protocol = protocol;
  Decoder decoder({});
  ImuBytes bytes;
  MotionSample sample;
  double acceleration_sum = 0, rate_sum = 0;
  while ((*reader)->read(bytes, {}) == ImuReadResult::bytes) {
    while (decoder.next(bytes, sample)) {
      const ImuSample& imu = std::get<ImuSample>(sample.value);
      result.stream.add(sample.time);
      result.rate_count += imu.has_rate;
      result.acceleration_count += imu.has_acceleration;
      result.orientation_count += imu.has_orientation;
      rate_sum += imu.rate_z_radps;
      acceleration_sum += std::hypot(imu.acceleration_x_mps2, imu.acceleration_y_mps2, imu.acceleration_z_mps2);
    }
  }
  result.byte_count = (*reader)->counters().byte_count;
  result.bad_line_count = (*reader)->counters().bad_line_count;
  if (result.acceleration_count > 0)
    result.mean_acceleration_mps2 = acceleration_sum / static_cast<double>(result.acceleration_count);
  if (result.rate_count > 0) result.mean_rate_z_radps = rate_sum / static_cast<double>(result.rate_count);
  note_decoder(decoder, result);
  return result;
}

}  // namespace

Expected<ImuInspection> inspect_imu(const std::string& path, const std::string& protocol) {
  if (protocol == "ncom") return decode_all<NcomDecoder>(path, protocol);
  Expected<ImuInspection> xsens = decode_all<XsensDecoder>(path, "xsens");
  if (!xsens || !protocol.empty()) return xsens;
  Expected<ImuInspection> ncom = decode_all<NcomDecoder>(path, "ncom");
  if (ncom && ncom->stream.count() > xsens->stream.count()) return ncom;
  return xsens;
}

void print_text(const ImuInspection& i, std::FILE* out) {
  std::fprintf(out, "IMU %s\n", i.path.c_str());
  std::fprintf(out,
               "  protocol       %s, %" PRIu64 " bytes, %" PRIu64 " bad checksums, %" PRIu64
               " bytes between messages, %" PRIu64 " messages lost, %" PRIu64 " bad lines\n",
               i.protocol.c_str(), i.byte_count, i.bad_checksum_count, i.skipped_byte_count, i.lost_message_count,
               i.bad_line_count);
  std::fprintf(out, "  samples        %" PRIu64 " in %.3f s, %s\n", i.stream.count(), i.stream.duration_s(),
               i.stream.text().c_str());
  std::fprintf(
      out, "  of these       %" PRIu64 " with rates, %" PRIu64 " with accelerations, %" PRIu64 " with orientation\n",
      i.rate_count, i.acceleration_count, i.orientation_count);
  std::fprintf(out, "  mean           acceleration %.3f m/s2 (standing: 9.81), rate about its z axis %+.5f rad/s\n",
               i.mean_acceleration_mps2, i.mean_rate_z_radps);
  for (const std::string& note : i.notes) std::fprintf(out, "  device         %s\n", note.c_str());
}

nlohmann::ordered_json json_of(const ImuInspection& i) {
  return {{"path", i.path},
          {"protocol", i.protocol},
          {"bytes", i.byte_count},
          {"bad_checksums", i.bad_checksum_count},
          {"bytes_between_messages", i.skipped_byte_count},
          {"lost_messages", i.lost_message_count},
          {"bad_lines", i.bad_line_count},
          {"stream", i.stream.json()},
          {"with_rate", i.rate_count},
          {"with_acceleration", i.acceleration_count},
          {"with_orientation", i.orientation_count},
          {"mean_acceleration_mps2", i.mean_acceleration_mps2},
          {"mean_rate_z_radps", i.mean_rate_z_radps},
          {"notes", i.notes}};
}

}  // namespace roadvec
