#include "daemon/stages/vehicle_stage.h"

namespace roadvec {
namespace {

// Long enough not to spin, short enough that a CAN frame waits no longer for the IMU than its own period.
constexpr std::chrono::milliseconds kTurn{4};
constexpr std::chrono::milliseconds kAtOnce{0};
constexpr std::uint64_t kTurnsPerReport = 32;          // a few times a second
constexpr int kMostPerTurn = 64;                       // then the other input has its turn
constexpr std::chrono::milliseconds kLongestTurn{20};  // two periods of a usual IMU

}  // namespace

VehicleStage::VehicleStage(std::vector<std::unique_ptr<MotionInput>> inputs, MotionChannel& motion, bool keeps_utc)
    : inputs_(std::move(inputs)), motion_(motion), keeps_utc_(keeps_utc), activity_(inputs_.size()) {}

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
    const auto begin = std::chrono::steady_clock::now();
    bool all_over = true;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      drain(i, stop);
      all_over = all_over && inputs_[i]->over();
    }
    if (all_over) return;
    const auto took = std::chrono::steady_clock::now() - begin;
    turn_times_.add(took);
    if (took > kLongestTurn) misses_.add();
  }
}

void VehicleStage::drain(std::size_t i, const std::stop_token& stop) noexcept {
  MotionInput& input = *inputs_[i];
  for (int count = 0; count < kMostPerTurn; ++count) {
    const MotionSample* sample = input.front(count == 0 ? kTurn : kAtOnce);
    if (sample == nullptr) return;
    activity_[i].last_sample.note();
    activity_[i].samples.add();
    // The sample may be a moment younger than the look before the turn.
    wall_clock_.look();
    MotionSample stamped = *sample;
    if (!keeps_utc_) stamped.time = wall_clock_.without_steps(sample->time);
    hand_over(stamped, stop);
    input.take();
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
