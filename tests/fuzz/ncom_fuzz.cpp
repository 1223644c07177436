#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/base/ensure.h"
#include "drivers/imu/ncom.h"

// The input as a stream of bytes, in pieces of the size its first byte says, and packet by packet with the right
// checksum, so that what lies behind it is reached.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  if (size == 0) return 0;
  const auto drain = [](NcomDecoder& decoder, ImuBytes bytes) {
    MotionSample sample;
    while (decoder.next(bytes, sample)) {
      const auto& imu = std::get<ImuSample>(sample.value);
      ENSURE(std::isfinite(imu.rate_z_radps) && std::isfinite(imu.acceleration_z_mps2) &&
             std::isfinite(imu.heading_rad));
    }
    ENSURE(bytes.bytes.empty());
  };
  NcomDecoder stream({});
  const std::size_t piece = 1 + data[0] % 200;
  for (std::size_t at = 1; at < size; at += piece)
    drain(stream, {{}, (at & 1) != 0, {data + at, std::min(piece, size - at)}});
  ENSURE(stream.counters().packet_count * kNcomPacketBytes + stream.counters().skipped_byte_count <= size - 1);

  NcomDecoder sealed({});
  for (std::size_t at = 1; at < size; at += kNcomPacketBytes) {
    std::array<std::uint8_t, kNcomPacketBytes> packet{};
    std::copy_n(data + at, std::min(size - at, packet.size()), packet.begin());
    packet[0] = 0xE7;
    unsigned sum = 0;
    for (std::size_t i = 1; i < 71; ++i) sum += packet[i];
    packet[71] = static_cast<std::uint8_t>(sum);
    drain(sealed, {{}, false, packet});
  }
  return 0;
}
