#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/base/ensure.h"
#include "drivers/velodyne/hdl64_status.h"
#include "tests/drivers/velodyne/streamed_table.h"

// A table as a head streams it, with the packets that the input loses, damages and repeats: three bytes each say how
// far to go on, what to do, and with which value. A table that is taken must be plausible; one that lost packets alone
// and went round three times must be taken.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  if (size < 2) return 0;
  StreamedTable head((data[0] & 1) != 0);
  head.skip(data[1] * 17U);
  Hdl64Status status;
  bool harmless = true;
  for (std::size_t at = 2; at + 3 <= size; at += 3) {
    for (unsigned i = 0; i < data[at] * 8U; ++i) {
      const StreamedTable::Packet packet = head.next();
      status.add(packet.type, packet.value, 0);
    }
    const std::uint8_t value = data[at + 2];
    switch (data[at + 1] % 4) {
      case 0:
        head.skip(value);
        status.add(head.peek().type, head.next().value, value);
        break;
      case 1:
        harmless = false;
        status.add(value, value, 0);
        break;
      case 2:
        harmless = false;
        status.add(head.next().type, value, 0);
        break;
      default:
        harmless = false;
        status.add(head.peek().type, head.next().value, value * 0x01000000U);
        break;
    }
  }
  for (unsigned i = 0; i < 3 * StreamedTable::kPackets; ++i) {
    const StreamedTable::Packet packet = head.next();
    status.add(packet.type, packet.value, 0);
  }
  ENSURE(status.table().complete() || !harmless);
  if (status.table().complete()) {
    for (const LaserCalibration& laser : status.table().calibration().lasers) ENSURE(std::abs(laser.distance_m) <= 10);
  }
  return 0;
}
