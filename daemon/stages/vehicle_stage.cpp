#include "daemon/stages/vehicle_stage.h"

namespace roadvec {
namespace {

// Long enough not to spin, short enough that a CAN frame waits no longer for the IMU than its own period.
constexpr std::chrono::milliseconds kTurn{4};
constexpr std::chrono::milliseconds kAtOnce{0};
constexpr std::uint64_t kTurnsPerReport = 32;  // a few times a second
constexpr int kMostPerTurn = 64;               // then the other input has its turn

}  // namespace

VehicleStage::VehicleStage(std::vector<std::unique_ptr<MotionInput>> inputs, MotionChannel& motion)
    : inputs_(std::move(inputs)), motion_(motion) {}

void VehicleStage::run(const std::stop_token& stop) noexcept {
  motion_.when_full() == WhenFull::wait ? merge(stop) : follow(stop);
  publish_counts();
  motion_.close();
}

void VehicleStage::merge(const std::stop_token& stop) noexcept {
  while (!stop.stop_requested()) {
    count_turn();
    MotionInput* earliest = nullptr;
    for (const auto& input : inputs_) {
      const MotionSample* sample = input->front(kAtOnce);
      if (sample != nullptr && (earliest == nullptr || sample->time < earliest->front(kAtOnce)->time))
        earliest = input.get();
    }
    if (earliest == nullptr) return;
    hand_over(*earliest->front(kAtOnce), stop);
    earliest->take();
  }
}

void VehicleStage::follow(const std::stop_token& stop) noexcept {
  while (!stop.stop_requested()) {
    count_turn();
    bool all_over = true;
    for (const auto& input : inputs_) {
      for (int i = 0; i < kMostPerTurn; ++i) {
        const MotionSample* sample = input->front(i == 0 ? kTurn : kAtOnce);
        if (sample == nullptr) break;
        hand_over(*sample, stop);
        input->take();
      }
      all_over = all_over && input->over();
    }
    if (all_over) return;
  }
}

void VehicleStage::count_turn() noexcept {
  turns_.add();
  if (turns_.value() % kTurnsPerReport == 0) publish_counts();
}

void VehicleStage::publish_counts() noexcept {
  VehicleCounts counts;
  for (const auto& input : inputs_) input->count(counts);
  counts_.store(counts);
}

void VehicleStage::hand_over(const MotionSample& sample, const std::stop_token& stop) noexcept {
  MotionSample* slot = motion_.claim(stop);
  if (slot == nullptr) {
    refused_.add();
    return;
  }
  *slot = sample;
  motion_.publish();
  samples_.add();
}

}  // namespace roadvec
