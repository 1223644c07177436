#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

namespace roadvec {

/// When something last came, by the steady clock, which nobody sets: one writer, any reader.
class LastHeard {
 public:
  void note() noexcept { ns_.store(now_ns(), std::memory_order_relaxed); }  // a report; orders nothing else
  /// Seconds since then; nothing: it never came.
  [[nodiscard]] std::optional<double> age_s() const noexcept {
    const std::int64_t ns = ns_.load(std::memory_order_relaxed);
    if (ns == 0) return std::nullopt;
    return static_cast<double>(now_ns() - ns) * 1e-9;
  }

 private:
  static std::int64_t now_ns() noexcept { return std::chrono::steady_clock::now().time_since_epoch().count(); }
  std::atomic<std::int64_t> ns_{0};
};

}  // namespace roadvec
