#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/base/ensure.h"
#include "drivers/velodyne/sensor_clock.h"

// The input as position packets, one after the other, and as an NMEA sentence: also with its right checksum, so that
// what lies behind is reached.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  const auto check = [](const NmeaFix& fix) {
    if (fix.place) ENSURE(std::abs(fix.place->latitude_deg) <= 90 && std::abs(fix.place->longitude_deg) <= 180);
    if (fix.time_of_day_ns) ENSURE(*fix.time_of_day_ns >= 0 && *fix.time_of_day_ns < 86'402'000'000'000);
  };
  std::string text(reinterpret_cast<const char*>(data), size);
  NmeaFix fix;
  if (parse_nmea(text, fix) == NmeaResult::fix) check(fix);
  unsigned sum = 0;
  std::erase(text, '*');
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  constexpr const char* kDigits = "0123456789ABCDEF";
  if (parse_nmea("$" + text + "*" + kDigits[sum >> 4] + kDigits[sum & 15], fix) == NmeaResult::fix) check(fix);

  SensorClock clock;
  for (std::size_t at = 0; at < size; at += kPositionPacketBytes) {
    RawPositionPacket packet;
    std::copy_n(data + at, std::min(size - at, packet.bytes.size()), packet.bytes.begin());
    if (const NmeaFix* news = clock.add(packet)) check(*news);
  }
  return 0;
}
