#include "daemon/stages/lidar_stage.h"

namespace roadvec {

LidarStage::LidarStage(std::unique_ptr<PacketSource> source, LidarModel model, const Calibration& calibration,
                       const SweepDecoderOptions& options, LidarCounters& counters, SweepChannel& sweeps,
                       Latencies& latencies)
    : source_(std::move(source)),
      sweeps_(sweeps),
      latencies_(latencies),
      decoder_(model, calibration, options, *this, counters),
      calibrated_(!calibration.streamed),
      live_(sweeps.when_full() == WhenFull::refuse),
      keeps_utc_(options.clock.base == PacketTimeBase::device_utc) {
  sweeps_.for_each_slot([model](Sweep& sweep) { sweep.returns.reserve(max_returns_per_sweep(model)); });
}

void LidarStage::run(const std::stop_token& stop) noexcept {
  stop_ = stop;
  std::span<const RawPacket> batch;
  while (!stop.stop_requested()) {
    turns_.add();
    const ReadResult result = source_->read(batch, kNap);
    if (result == ReadResult::end || result == ReadResult::failed) break;
    if (live_) look_at_clock();
    if (result == ReadResult::quiet) continue;
    add(batch);
    for (const RawPositionPacket& packet : source_->positions()) sensor_clock_.add(packet);
    report_clock();
  }
  decoder_.finish();
  sweeps_.close();
}

void LidarStage::add(std::span<const RawPacket> batch) noexcept {
  const Clock::time_point begin = Clock::now();
  if (!batch.empty()) last_packet_.note();
  waited_ = {};
  for (const RawPacket& packet : batch) {
    if (live_) {
      received_ns_ = std::chrono::nanoseconds(begin.time_since_epoch()).count() - wall_clock_.age_ns(packet.arrived);
      packet_steps_ns_ = packet.arrived - wall_clock_.without_steps(packet.arrived);
    }
    decoder_.add(packet);
  }
  calibrated_.store(decoder_.calibrated(), std::memory_order_relaxed);
  decode_time_ += Clock::now() - begin - waited_;
}

void LidarStage::look_at_clock() noexcept {
  const std::uint64_t before = wall_clock_.step_count();
  wall_clock_.look();
  if (wall_clock_.step_count() != before) report_clock();
}

void LidarStage::report_clock() noexcept {
  clock_.store(
      {sensor_clock_.report(), decoder_.clock().state(), wall_clock_.step_count(), wall_clock_.last_step_ns()});
}

Sweep* LidarStage::claim() noexcept {
  const Clock::time_point begin = Clock::now();
  filling_ = sweeps_.claim(stop_);
  waited_ += Clock::now() - begin;
  steps_ns_ = packet_steps_ns_;
  return filling_;
}

void LidarStage::publish() noexcept {
  filling_->received_ns = received_ns_;
  if (!keeps_utc_) {
    filling_->start = filling_->start - steps_ns_;
    filling_->end = filling_->end - steps_ns_;
  }
  if (filling_->complete && decode_time_.count() > filling_->end - filling_->start) misses_.add();
  sweeps_.publish();
  published_.add();
  latencies_.note(Station::sweep, received_ns_);
  timer_.add(Step::decode, decode_time_);
  decode_time_ = {};
}

}  // namespace roadvec
