#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/base/ensure.h"
#include "tests/drivers/velodyne/packets.h"

// Packets of 1206 bytes from the input, one after the other, through decoder, clock and assembler. The first byte
// chooses model and clock; flags are put right on request, because otherwise nothing would get past them. An HDL-64E
// waits for the calibration that it streams on request of the second byte's lowest bit.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  if (size < 2) return 0;
  const LidarModel model = kAllModels[data[0] % std::size(kAllModels)];
  const auto base = static_cast<PacketTimeBase>(data[0] / std::size(kAllModels) % 3);
  const bool good_flags = (data[0] & 0x80) == 0;
  const std::int64_t step_ns = std::int64_t{data[1]} * data[1] * 100'000 - 100'000;
  const bool streamed = facts_of(model).needs_calibration() && (data[1] & 1) != 0;
  Bench bench(model, streamed ? Calibration{.streamed = true} : calibration_of(model), {.clock = {.base = base}});
  bench.sink.capacity = 20'000;
  std::int64_t arrived_ns = 1'700'000'000'000'000'000;
  for (std::size_t at = 2; at < size; at += kPacketBytes) {
    RawPacket packet;
    std::memcpy(packet.bytes.data(), data + at, std::min(kPacketBytes, size - at));
    packet.arrived = {arrived_ns += step_ns};
    const bool dual = facts_of(model).dual != DualLayout::none && packet.bytes[kReturnModeOffset] == kDualReturnMode;
    const GroupLayout layout = group_layout(model, dual && model == LidarModel::vls128);
    for (int block = 0; good_flags && block < kBlocksPerPacket; ++block) {
      const bool used = block < kBlocksPerPacket / layout.block_count * layout.block_count;
      const GroupLayout::Block& role = layout.blocks[static_cast<std::size_t>(block % layout.block_count)];
      put_flag(packet.bytes, block, used ? kBankFlags[role.bank] : kEmptyBlockFlags[1]);
    }
    bench.driver.add(packet);
  }
  bench.driver.finish();
  for (const Sweep& sweep : bench.sink.sweeps) {
    ENSURE(sweep.returns.size() <= bench.sink.capacity && sweep.start <= sweep.end);
    ENSURE(std::ranges::is_sorted(sweep.returns, {}, &Return::time_ns));
    for (const Return& r : sweep.returns)
      ENSURE(r.azimuth_rad >= 0.0F && r.azimuth_rad < 6.2831855F && r.x_m * r.x_m < 90'000.0F);
  }
  return 0;
}
