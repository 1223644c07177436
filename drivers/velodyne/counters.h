#pragma once

#include <atomic>
#include <cstdint>

namespace roadvec {

/// A number that one thread counts up and any thread may read.
class Counter {
 public:
  void add(std::uint64_t n = 1) noexcept {
    // One writer: a relaxed load and store do, and spare the bus lock of fetch_add. Counters order nothing else.
    value_.store(value_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t value() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_{0};
};

/// What became of everything a LiDAR sent. T is Counter where it is counted (by the lidar thread alone) or a number in
/// a copy.
template <class T>
struct LidarCounterSet {
  // the way in
  T received{};          ///< data packets of the right length from the right sender
  T wrong_length{};      ///< datagrams on the data port that are not 1206 bytes long
  T wrong_flags{};       ///< packets whose blocks are not laid out as the configured model's: dropped
  T foreign_source{};    ///< datagrams from another sender than the configured one
  T fragments{};         ///< recordings: parts of datagrams that were split on the way; they are not put together
  T cut_short{};         ///< recordings: packets of which the capture kept the beginning alone (snap length)
  T before_start{};      ///< data packets that lay in a socket handed over, from before we came: not used
  T kernel_drops{};      ///< datagrams the kernel threw away because the receive buffer was full
  T device_time_gaps{};  ///< packets missing by the sensor's own clock (estimate; includes kernel_drops and reordered)
  T reordered{};         ///< packets older than one already decoded, or the same again: dropped
  T ring_full{};         ///< revolutions dropped because the next stage was behind
  T unread_mode{};   ///< packets in a return mode that is not decoded (VLS-128: triple, or with confidence): dropped
  T uncalibrated{};  ///< packets before the table that the sensor streams was complete: dropped
  T position_packets{};       ///< position (telemetry) packets of the right length from the right sender
  T position_wrong_length{};  ///< datagrams on their port that are not 512 bytes long
  // inside a packet or a revolution
  T wrong_azimuth{};   ///< block groups whose azimuth is not below 360 degrees: dropped
  T clock_steps{};     ///< the sensor's clock jumped against the host's, or the host's clock jumped
  T head_stopped{};    ///< sweeps withdrawn because the head stood still or turned slower than 4.5 times a second
  T sweep_overflow{};  ///< returns that did not fit into the slot's reserved memory
};
using LidarCounters = LidarCounterSet<Counter>;
using LidarCounts = LidarCounterSet<std::uint64_t>;

/// visit(name, counter) for each, in the order above. `counters` is a LidarCounters or LidarCounts, const or not.
template <class Set, class Visitor>
void visit_counters(Set& counters, Visitor&& visit) {
  visit("received", counters.received);
  visit("wrong_length", counters.wrong_length);
  visit("wrong_flags", counters.wrong_flags);
  visit("foreign_source", counters.foreign_source);
  visit("fragments", counters.fragments);
  visit("cut_short", counters.cut_short);
  visit("before_start", counters.before_start);
  visit("kernel_drops", counters.kernel_drops);
  visit("device_time_gaps", counters.device_time_gaps);
  visit("reordered", counters.reordered);
  visit("ring_full", counters.ring_full);
  visit("unread_mode", counters.unread_mode);
  visit("uncalibrated", counters.uncalibrated);
  visit("position_packets", counters.position_packets);
  visit("position_wrong_length", counters.position_wrong_length);
  visit("wrong_azimuth", counters.wrong_azimuth);
  visit("clock_steps", counters.clock_steps);
  visit("head_stopped", counters.head_stopped);
  visit("sweep_overflow", counters.sweep_overflow);
}

/// A copy to report from, while the lidar thread goes on counting.
[[nodiscard]] inline LidarCounts snapshot(const LidarCounters& counters) noexcept {
  return {.received = counters.received.value(),
          .wrong_length = counters.wrong_length.value(),
          .wrong_flags = counters.wrong_flags.value(),
          .foreign_source = counters.foreign_source.value(),
          .fragments = counters.fragments.value(),
          .cut_short = counters.cut_short.value(),
          .before_start = counters.before_start.value(),
          .kernel_drops = counters.kernel_drops.value(),
          .device_time_gaps = counters.device_time_gaps.value(),
          .reordered = counters.reordered.value(),
          .ring_full = counters.ring_full.value(),
          .unread_mode = counters.unread_mode.value(),
          .uncalibrated = counters.uncalibrated.value(),
          .position_packets = counters.position_packets.value(),
          .position_wrong_length = counters.position_wrong_length.value(),
          .wrong_azimuth = counters.wrong_azimuth.value(),
          .clock_steps = counters.clock_steps.value(),
          .head_stopped = counters.head_stopped.value(),
          .sweep_overflow = counters.sweep_overflow.value()};
}

}  // namespace roadvec
