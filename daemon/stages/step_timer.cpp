#include "daemon/stages/step_timer.h"

#include <algorithm>
#include <cmath>

namespace roadvec {

std::size_t DurationHistogram::bucket_of(double us) noexcept {
  if (!(us > 1.0)) return 0;
  const auto bucket = static_cast<std::size_t>(std::ceil(std::log2(us) * kStepsPerOctave));
  return std::min(bucket, kStepsPerOctave * kOctaves - 1);
}

void DurationHistogram::add(std::chrono::nanoseconds duration) noexcept {
  const auto ns = static_cast<std::uint64_t>(std::max<std::int64_t>(duration.count(), 0));
  std::atomic<std::uint32_t>& count = counts_[bucket_of(static_cast<double>(ns) * 1e-3)];
  // One writer: relaxed load and store spare the bus lock; readers want no order between buckets.
  count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (ns > max_ns_.load(std::memory_order_relaxed)) max_ns_.store(ns, std::memory_order_relaxed);
  sum_ns_.store(sum_ns_.load(std::memory_order_relaxed) + ns, std::memory_order_relaxed);
}

DurationHistogram::Summary DurationHistogram::summary() const noexcept {
  Summary summary;
  std::array<std::uint32_t, kStepsPerOctave * kOctaves> counts;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    counts[i] = counts_[i].load(std::memory_order_relaxed);
    summary.count += counts[i];
  }
  summary.max_us = static_cast<double>(max_ns_.load(std::memory_order_relaxed)) * 1e-3;
  summary.sum_us = static_cast<double>(sum_ns_.load(std::memory_order_relaxed)) * 1e-3;
  const auto percentile = [&](double share) {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(summary.count)));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      seen += counts[i];
      if (seen >= wanted) return std::min(std::exp2(static_cast<double>(i) / kStepsPerOctave), summary.max_us);
    }
    return summary.max_us;
  };
  if (summary.count == 0) return summary;
  summary.p50_us = percentile(0.50);
  summary.p99_us = percentile(0.99);
  return summary;
}

std::array<std::uint64_t, DurationHistogram::kLastOctave - DurationHistogram::kFirstOctave + 1>
DurationHistogram::at_most_counts() const noexcept {
  std::array<std::uint64_t, kLastOctave - kFirstOctave + 1> counts{};
  std::uint64_t seen = 0;
  for (std::size_t i = 0, octave = kFirstOctave; octave <= kLastOctave; ++octave) {
    for (; i <= octave * kStepsPerOctave; ++i) seen += counts_[i].load(std::memory_order_relaxed);
    counts[octave - kFirstOctave] = seen;
  }
  return counts;
}

}  // namespace roadvec
