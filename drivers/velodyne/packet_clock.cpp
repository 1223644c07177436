#include "drivers/velodyne/packet_clock.h"

#include <cstdlib>

namespace roadvec {
namespace {

constexpr std::int64_t kMillisecond_ns = 1'000'000;
/// A packet that comes this much too late is out of order; a clock that goes back further was set.
constexpr std::int64_t kLongestReordering_ns = 100 * kMillisecond_ns;
/// Both clocks saw the same pause, within what a stalled host or a burst of queued packets can bend.
constexpr std::int64_t kClocksAgree_ns = 500 * kMillisecond_ns;
/// A pause by the host's clock alone (the sensor's was set meanwhile) that is more than scheduling.
constexpr std::int64_t kHostPause_ns = 50 * kMillisecond_ns;
/// Longer than this without a firing, and what follows is another revolution (75 degrees at the slowest).
constexpr std::int64_t kLongestPause_ns = 60 * kMillisecond_ns;
/// Packets queued in the kernel or on the wire are never this much out of time: the clock was set.
constexpr std::int64_t kSetBack_ns = -500 * kMillisecond_ns;
/// The kernel stamps a socket's packets in order: stamps go back only when the host's clock is set.
constexpr std::int64_t kHostWentBack_ns = -kMillisecond_ns;
/// Crystals of sensor and host differ by less than this; so fast may the offset follow a sensor that runs slow.
constexpr std::int64_t kDriftDivisor = 10'000;  // 100 parts in a million

/// `step_ns` from the start of one packet, which took `last_duration_ns`, to that of the next.
std::uint32_t packets_missing(std::int64_t step_ns, std::uint32_t last_duration_ns,
                              std::uint32_t duration_ns) noexcept {
  const std::int64_t count = (step_ns - last_duration_ns + duration_ns / 2) / duration_ns;
  return count > 0 ? static_cast<std::uint32_t>(count) : 0;
}

}  // namespace

PacketTiming PacketClock::place(const RawPacket& packet, std::uint32_t duration_ns,
                                std::uint16_t azimuth_cdeg) noexcept {
  const std::int64_t device_ns = static_cast<std::int64_t>(device_time_us(packet.bytes)) * 1000;
  const std::int64_t device_step_ns = wrap_hour_ns(device_ns - last_device_ns_);
  const std::int64_t host_step_ns = packet.arrived - last_arrived_;
  const Step step = started_ ? classify(device_step_ns, host_step_ns, azimuth_cdeg) : Step::first;
  PacketTiming timing;
  if (step == Step::stale) {
    counters_.reordered.add();
    timing.stale = true;
    return timing;
  }
  if (step == Step::forward) timing.lost_before_count = packets_missing(device_step_ns, last_duration_ns_, duration_ns);
  if (step == Step::clock_step) {
    counters_.clock_steps.add();
    if (host_step_ns > kHostPause_ns && host_step_ns < kHour_ns) {
      timing.lost_before_count = packets_missing(host_step_ns, last_duration_ns_, duration_ns);
    }
  }
  counters_.device_time_gaps.add(timing.lost_before_count);
  timing.first_firing = first_firing(packet, duration_ns, step, device_step_ns);
  const std::int64_t pause_ns =
      step == Step::clock_step ? timing.first_firing - last_end_ : device_step_ns - last_duration_ns_;
  timing.apart = step != Step::first && (pause_ns > kLongestPause_ns || pause_ns < kSetBack_ns);
  last_end_ = timing.first_firing + duration_ns;

  state_.device_minus_host_ns = wrap_hour_ns(device_ns - (packet.arrived - duration_ns).ns % kHour_ns);
  if (step == Step::clock_step) state_.last_step = {device_step_ns - host_step_ns, packet.arrived};
  started_ = true;
  last_arrived_ = packet.arrived;
  last_device_ns_ = device_ns;
  last_duration_ns_ = duration_ns;
  last_azimuth_cdeg_ = azimuth_cdeg;
  return timing;
}

PacketClock::Step PacketClock::classify(std::int64_t device_step_ns, std::int64_t host_step_ns,
                                        std::uint16_t azimuth_cdeg) const noexcept {
  if (device_step_ns <= 0 && device_step_ns > -kLongestReordering_ns) {
    // A late packet also looks back; when the head went on while its clock went back, the clock was set (or does not
    // run).
    const bool head_went_on = azimuth_step_cdeg(last_azimuth_cdeg_, azimuth_cdeg) > 0;
    return head_went_on ? Step::clock_step : Step::stale;
  }
  if (device_step_ns < 0 || host_step_ns < kHostWentBack_ns ||
      std::llabs(device_step_ns - host_step_ns) > kClocksAgree_ns)
    return Step::clock_step;
  return Step::forward;
}

SensorTime PacketClock::first_firing(const RawPacket& packet, std::uint32_t duration_ns, Step step,
                                     std::int64_t device_step_ns) noexcept {
  const SensorTime by_arrival = packet.arrived - duration_ns;
  if (options_.base == PacketTimeBase::arrival) return by_arrival;
  if (options_.base == PacketTimeBase::device_utc) {
    const bool at_first = options_.stamp == PacketStampMeaning::first_firing;
    const std::int64_t first_ns = static_cast<std::int64_t>(device_time_us(packet.bytes)) * 1000 -
                                  (at_first ? 0 : static_cast<std::int64_t>(duration_ns));
    return by_arrival + wrap_hour_ns(first_ns - by_arrival.ns % kHour_ns);
  }
  if (step != Step::forward) {
    unwrapped_ns_ = 0;
    offset_ns_ = by_arrival.ns;
    return by_arrival;
  }
  // Nothing arrives before it was sent: the earliest arrival is the truest, a later one only lets the offset creep
  // towards it.
  unwrapped_ns_ += device_step_ns;
  const std::int64_t late_ns = by_arrival.ns - unwrapped_ns_ - offset_ns_;
  const std::int64_t creep_ns = device_step_ns / kDriftDivisor;
  offset_ns_ += late_ns < creep_ns ? late_ns : creep_ns;
  return {unwrapped_ns_ + offset_ns_};
}

}  // namespace roadvec
