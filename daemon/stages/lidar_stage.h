#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>

#include "core/ring/latest.h"
#include "daemon/stages/channels.h"
#include "daemon/stages/last_heard.h"
#include "daemon/stages/latency.h"
#include "daemon/stages/step_timer.h"
#include "daemon/stages/wall_clock.h"
#include "drivers/velodyne/packet_source.h"
#include "drivers/velodyne/sensor_clock.h"
#include "drivers/velodyne/sweep_decoder.h"

namespace roadvec {

/// The sensor's clock as the lidar thread knows it.
struct LidarClockReport {
  SensorClockReport gps;
  PacketClockState stamps;
  std::uint64_t host_step_count = 0;
  std::int64_t last_host_step_ns = 0;
};

/// Thread `rv-lidar`: packets -> sweeps. Receives, decodes and assembles straight into the ring's slots.
class LidarStage final : private SweepSink {
 public:
  LidarStage(std::unique_ptr<PacketSource> source, LidarModel model, const Calibration& calibration,
             const SweepDecoderOptions& options, LidarCounters& counters, SweepChannel& sweeps, Latencies& latencies);

  /// Until the recording ends, reading fails or stop is asked for; then closes the channel.
  void run(const std::stop_token& stop) noexcept;

  [[nodiscard]] const StepTimer& timer() const { return timer_; }
  [[nodiscard]] const Counter& turns() const { return turns_; }
  [[nodiscard]] const Counter& sweeps_published() const { return published_; }
  [[nodiscard]] const Counter& misses() const { return misses_; }  ///< sweeps that took longer than their revolution
  [[nodiscard]] const LastHeard& last_packet() const { return last_packet_; }
  /// The calibration is there: from the start, or once the sensor has streamed it.
  [[nodiscard]] bool calibrated() const { return calibrated_.load(std::memory_order_relaxed); }
  /// Why reading ended before the end of the recording; empty: it did not. Read it after run().
  [[nodiscard]] std::string_view error() const { return source_->error(); }
  /// What a person should know of the recording or the port. Read it before or after run().
  [[nodiscard]] std::string_view warning() const { return source_->warning(); }
  [[nodiscard]] const Senders* senders() const { return source_->senders(); }
  [[nodiscard]] Latest<LidarClockReport>& clock() { return clock_; }  ///< reader: main thread

 private:
  using Clock = std::chrono::steady_clock;
  void add(std::span<const RawPacket> batch) noexcept;
  void look_at_clock() noexcept;
  void report_clock() noexcept;
  Sweep* claim() noexcept override;
  void publish() noexcept override;

  std::unique_ptr<PacketSource> source_;
  SweepChannel& sweeps_;
  Latencies& latencies_;
  SweepDecoder decoder_;
  SensorClock sensor_clock_;
  Latest<LidarClockReport> clock_;
  StepTimer timer_;
  Counter turns_, published_, misses_;
  LastHeard last_packet_;
  std::atomic<bool> calibrated_;  ///< a report; orders nothing else
  std::stop_token stop_;
  std::chrono::nanoseconds decode_time_{0}, waited_{0};
  bool live_, keeps_utc_;
  WallClock wall_clock_;
  Sweep* filling_ = nullptr;                            ///< the slot last claimed
  std::int64_t steps_ns_ = 0;                           ///< what the wall clock was set by until its first packet
  std::int64_t packet_steps_ns_ = 0, received_ns_ = 0;  ///< of the packet being decoded; the latter by the steady clock
};

}  // namespace roadvec
