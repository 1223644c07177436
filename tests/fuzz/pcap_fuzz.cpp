#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/base/ensure.h"
#include "drivers/recording/frame.h"
#include "drivers/velodyne/pcap_reader.h"

// The input as one captured frame of each link layer, and as a whole capture.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  for (const LinkLayer link : {LinkLayer::ethernet, LinkLayer::linux_cooked, LinkLayer::linux_cooked2,
                               LinkLayer::raw_ip, LinkLayer::loopback}) {
    const CapturedFrame frame = parse_frame(link, {data, size});
    if (frame.datagram)
      ENSURE(frame.datagram->payload.size() <= size && frame.datagram->payload.size() <= frame.datagram->length);
  }
  static const int file = ::memfd_create("pcap", 0);
  ENSURE(::ftruncate(file, 0) == 0 && ::pwrite(file, data, size, 0) == static_cast<ssize_t>(size));
  LidarCounters counters;
  auto reader = PcapReader::open("/proc/self/fd/" + std::to_string(file), {.port = 0}, counters);
  if (!reader) return 0;
  std::span<const RawPacket> batch;
  std::uint64_t packet_count = 0;
  while ((*reader)->read(batch, {}) == ReadResult::packets) packet_count += batch.size();
  ENSURE(packet_count == counters.received.value());
  return 0;
}
