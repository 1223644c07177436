#include "drivers/velodyne/sweep_decoder.h"

#include <algorithm>

namespace roadvec {

void SweepDecoder::add(const RawPacket& packet) noexcept {
  if (!decoder_.decode(packet.bytes, decoded_)) return;
  const auto* const groups_end = decoded_.groups.data() + decoded_.group_count;
  const auto* const usable =
      std::find_if(std::as_const(decoded_).groups.data(), groups_end, [](const auto& g) { return g.usable; });
  if (usable == groups_end) return;
  const PacketTiming timing = clock_.place(packet, decoder_.duration_ns(decoded_), usable->azimuth_cdeg);
  if (timing.stale) return;
  if (has_status_) {
    status_.add(packet.bytes[kReturnModeOffset], packet.bytes[kProductIdOffset], timing.lost_before_count);
  }
  if (!calibrated_) {
    counters_.uncalibrated.add();
    if (!status_.table().complete()) return;
    decoder_.calibrate(status_.table().calibration());
    calibrated_ = true;
    return;
  }
  assembler_.add(decoded_, timing);
}

}  // namespace roadvec
