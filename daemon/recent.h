#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace roadvec {

/// How much counters have grown of late: within three seconds or so, when it is fed about once a second. Times are
/// seconds on a steady clock, given by the caller.
template <std::size_t N>
class Recent {
 public:
  using Counts = std::array<std::uint64_t, N>;
  void add(double time_s, const Counts& counts) {
    if (filled_ > 0 && time_s - times_s_[0] < kLeastStep_s) return;
    std::rotate(times_s_.begin(), times_s_.end() - 1, times_s_.end());
    std::rotate(counts_.begin(), counts_.end() - 1, counts_.end());
    times_s_[0] = time_s;
    counts_[0] = counts;
    filled_ = std::min(filled_ + 1, kSlots);
  }
  [[nodiscard]] double growth(std::size_t i) const {
    return filled_ < 2 ? 0 : static_cast<double>(counts_[0][i] - counts_[filled_ - 1][i]);
  }
  [[nodiscard]] double rate_hz(std::size_t i) const {
    return filled_ < 2 ? 0 : growth(i) / (times_s_[0] - times_s_[filled_ - 1]);
  }
  /// Since the look before the last: what still comes now.
  [[nodiscard]] double newest_hz(std::size_t i) const {
    return filled_ < 2 ? 0 : static_cast<double>(counts_[0][i] - counts_[1][i]) / (times_s_[0] - times_s_[1]);
  }

 private:
  static constexpr std::size_t kSlots = 4;
  static constexpr double kLeastStep_s = 0.5;
  std::array<double, kSlots> times_s_{};  ///< newest first
  std::array<Counts, kSlots> counts_{};
  std::size_t filled_ = 0;
};

}  // namespace roadvec
