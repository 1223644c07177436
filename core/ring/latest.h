#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace roadvec {

/// Mailbox for one writer thread and one reader thread in which the newest value wins: a triple buffer. Neither side
/// waits.
template <class T>
class Latest {
 public:
  /// Writer: the value replaces whatever the reader has not fetched yet.
  void store(const T& value) noexcept {
    slots_[write_] = value;
    // (A) acq_rel: release the slot just filled; acquire the slot that the reader gave back.
    write_ = middle_.exchange(write_ | kFresh, std::memory_order_acq_rel) & kIndex;
  }
  /// Reader: the newest value; `false` from fresh() means the same one as last time. T{} before the first store().
  const T& load() noexcept {
    if (fresh()) {
      // (A) acq_rel: acquire the writer's slot; release ours, which the writer will fill next.
      read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    }
    return slots_[read_];
  }
  [[nodiscard]] bool fresh() const noexcept { return (middle_.load(std::memory_order_relaxed) & kFresh) != 0; }

 private:
  static constexpr std::uint32_t kFresh = 4, kIndex = 3;
  std::array<T, 3> slots_{};
  std::uint32_t write_ = 0;
  alignas(64) std::atomic<std::uint32_t> middle_{1};
  alignas(64) std::uint32_t read_ = 2;
};

}  // namespace roadvec
