#include "daemon/stages/lidar_stage.h"

namespace roadvec {

LidarStage::LidarStage(std::unique_ptr<PacketSource> source, LidarModel model, const Calibration& calibration,
                       const SweepDecoderOptions& options, LidarCounters& counters, SweepChannel& sweeps)
    : source_(std::move(source)),
      sweeps_(sweeps),
      decoder_(model, calibration, options, *this, counters),
      calibrated_(!calibration.streamed) {
  sweeps_.for_each_slot([model](Sweep& sweep) { sweep.returns.reserve(max_returns_per_sweep(model)); });
}

void LidarStage::run(const std::stop_token& stop) noexcept {
  stop_ = stop;
  std::span<const RawPacket> batch;
  while (!stop.stop_requested()) {
    turns_.add();
    const ReadResult result = source_->read(batch, kNap);
    if (result == ReadResult::end || result == ReadResult::failed) break;
    if (result == ReadResult::quiet) continue;
    const Clock::time_point begin = Clock::now();
    waited_ = {};
    for (const RawPacket& packet : batch) decoder_.add(packet);
    calibrated_.store(decoder_.calibrated(), std::memory_order_relaxed);
    decode_time_ += Clock::now() - begin - waited_;
    for (const RawPositionPacket& packet : source_->positions()) sensor_clock_.add(packet);
    clock_.store({sensor_clock_.report(), decoder_.clock().state()});
  }
  decoder_.finish();
  sweeps_.close();
}

Sweep* LidarStage::claim() noexcept {
  const Clock::time_point begin = Clock::now();
  Sweep* slot = sweeps_.claim(stop_);
  waited_ += Clock::now() - begin;
  return slot;
}

void LidarStage::publish() noexcept {
  sweeps_.publish();
  published_.add();
  timer_.add(Step::decode, decode_time_);
  decode_time_ = {};
}

}  // namespace roadvec
