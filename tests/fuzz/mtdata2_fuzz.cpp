#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/ensure.h"
#include "drivers/imu/xsens.h"

using namespace roadvec;

/// Any bytes, cut anywhere: every one is taken, and the samples are the same however they are cut.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::size_t piece = 1 + data[0];
  const std::span<const std::uint8_t> bytes(data + 1, size - 1);
  MotionSample sample;
  XsensDecoder whole({.roll_rad = 0.1, .pitch_rad = 0.2, .yaw_rad = 0.3});
  ImuBytes all{{1}, true, bytes};
  std::size_t whole_count = 0;
  while (whole.next(all, sample)) ++whole_count;
  ENSURE(all.bytes.empty());
  XsensDecoder cut({.roll_rad = 0.1, .pitch_rad = 0.2, .yaw_rad = 0.3});
  std::size_t cut_count = 0;
  for (std::size_t i = 0; i < bytes.size(); i += piece) {
    ImuBytes part{{}, false, bytes.subspan(i, bytes.size() - i < piece ? bytes.size() - i : piece)};
    while (cut.next(part, sample)) ++cut_count;
    ENSURE(part.bytes.empty());
  }
  ENSURE(cut_count + cut.untimed_count() == whole_count);
  ENSURE(cut.counters().message_count == whole.counters().message_count);
  XsensSample content;
  parse_mtdata2(bytes, content);
  static_cast<void>(SensorToVehicle({}).convert(sensor_axes_of(content)));
  return 0;
}
