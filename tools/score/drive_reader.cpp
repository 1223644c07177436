#include "tools/score/drive_reader.h"

#include <algorithm>
#include <utility>

namespace roadvec {
namespace {

constexpr std::chrono::milliseconds kAtOnce{0};
constexpr std::int64_t kRunUp_ns = 5'000'000'000;  // motion before the first sweep that the filter starts on

}  // namespace

Expected<std::unique_ptr<DriveReader>> DriveReader::open(const Settings& drive) {
  std::unique_ptr<DriveReader> reader(new DriveReader);
  auto lidar = open_lidar(drive.lidar, InputKind::recorded, reader->counters_);
  if (!lidar) return tl::unexpected(lidar.error());
  auto vehicle = open_vehicle(drive, InputKind::recorded);
  if (!vehicle) return tl::unexpected(vehicle.error());
  reader->lidar_ = std::move(*lidar);
  reader->vehicle_ = std::move(*vehicle);
  reader->setup_ = front_end_setup(drive, reader->lidar_.model);
  reader->filling_.returns.reserve(reader->setup_.max_returns_per_sweep);
  SweepSink& sink = *reader;
  reader->decoder_ = std::make_unique<SweepDecoder>(reader->lidar_.model, reader->lidar_.calibration,
                                                    reader->lidar_.options, sink, reader->counters_);
  return reader;
}

void DriveReader::publish() noexcept {
  ready_.push_back(std::exchange(filling_, {}));
  filling_.returns.reserve(setup_.max_returns_per_sweep);
}

const Sweep* DriveReader::next() {
  std::span<const RawPacket> batch;
  while (ready_.empty() && !over_) {
    const ReadResult result = lidar_.source->read(batch, kAtOnce);
    over_ = result == ReadResult::end || result == ReadResult::failed;
    if (result == ReadResult::packets) {
      for (const RawPacket& packet : batch) decoder_->add(packet);
    }
    if (over_) decoder_->finish();
  }
  if (ready_.empty()) return nullptr;
  current_ = std::move(ready_.front());
  ready_.pop_front();
  take_motion();
  return &current_;
}

MotionInput* DriveReader::earliest() const {
  MotionInput* earliest = nullptr;
  for (const auto& input : vehicle_.inputs) {
    const MotionSample* sample = input->front(kAtOnce);
    if (sample == nullptr) continue;
    if (earliest == nullptr || sample->time < earliest->front(kAtOnce)->time) earliest = input.get();
  }
  return earliest;
}

void DriveReader::take_motion() {
  motion_.clear();
  for (MotionInput* input = earliest(); input != nullptr; input = earliest()) {
    const MotionSample& sample = *input->front(kAtOnce);
    if (sample.time > current_.end) break;
    if (started_ || sample.time >= current_.start - kRunUp_ns) motion_.push_back(sample);
    input->take();
  }
  started_ = true;
}

}  // namespace roadvec
