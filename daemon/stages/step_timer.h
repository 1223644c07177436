#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>

#include "core/pipeline/report.h"

namespace roadvec {

/// Histogram of durations from 1 us to 17 s in steps of 1/16 of an octave: fixed memory, one writer, any reader. No
/// allocation, lock or system call.
class DurationHistogram {
 public:
  void add(std::chrono::nanoseconds duration) noexcept;
  struct Summary {
    std::uint64_t count = 0;
    double p50_us = 0, p99_us = 0, max_us = 0;  ///< percentiles: upper edge of their step, at most 4.4 % too high
    double sum_us = 0;
  };
  [[nodiscard]] Summary summary() const noexcept;
  /// How many took at most 1.024, 2.048, 4.096, ... ms: exact, these are edges of steps. The last is 8.4 s.
  static constexpr std::size_t kFirstOctave = 10, kLastOctave = 23;
  [[nodiscard]] std::array<std::uint64_t, kLastOctave - kFirstOctave + 1> at_most_counts() const noexcept;

 private:
  static constexpr std::size_t kStepsPerOctave = 16, kOctaves = 24;
  [[nodiscard]] static std::size_t bucket_of(double us) noexcept;
  std::array<std::atomic<std::uint32_t>, kStepsPerOctave * kOctaves> counts_{};
  std::atomic<std::uint64_t> max_ns_{0}, sum_ns_{0};
};

/// Times the steps of one thread.
class StepTimer final : public StepProbe {
 public:
  void begin() noexcept override { last_ = Clock::now(); }
  void done(Step step) noexcept override {
    const Clock::time_point now = Clock::now();
    histograms_[static_cast<std::size_t>(step)].add(now - last_);
    last_ = now;
  }
  /// A duration measured elsewhere.
  void add(Step step, std::chrono::nanoseconds duration) noexcept {
    histograms_[static_cast<std::size_t>(step)].add(duration);
  }
  [[nodiscard]] const DurationHistogram& histogram(Step step) const noexcept {
    return histograms_[static_cast<std::size_t>(step)];
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_;
  std::array<DurationHistogram, kStepCount> histograms_;
};

}  // namespace roadvec
