#pragma once

#include <algorithm>
#include <chrono>

namespace roadvec {

/// When to try again what failed: after 100 ms, then twice as long each time, 2 s at most. Counts the time its owner
/// says it has waited, so it needs no clock.
class Backoff {
 public:
  /// True once the current pause is over; the next pause is then twice as long.
  [[nodiscard]] bool due_after(std::chrono::milliseconds waited) noexcept {
    waited_ += waited;
    if (waited_ < pause_) return false;
    waited_ = {};
    pause_ = std::min(2 * pause_, kLongest);
    return true;
  }
  void reset() noexcept { *this = Backoff(); }

 private:
  static constexpr std::chrono::milliseconds kFirst{100};
  static constexpr std::chrono::milliseconds kLongest{2000};

  std::chrono::milliseconds waited_{0};
  std::chrono::milliseconds pause_ = kFirst;
};

}  // namespace roadvec
