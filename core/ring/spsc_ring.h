#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <memory>

namespace roadvec {

/// Wait-free ring of N preallocated slots between one producer thread and one consumer thread.
///
/// The producer fills a slot in place: `if (T* slot = ring.claim()) { fill(*slot); ring.publish(); }`, the consumer
/// reads it in place: `if (T* slot = ring.front()) { use(*slot); ring.pop(); }`. Null from claim(): full; what that
/// means (refuse and count, or wait) is the owner's choice. Slots live on the heap and are never moved; their own
/// buffers survive from lap to lap. No allocation, lock or system call after the constructor.
template <class T, std::size_t N>
class SpscRing {
  static_assert(N >= 2 && (N & (N - 1)) == 0, "N is a power of two");

 public:
  SpscRing() : slots_(std::make_unique<std::array<T, N>>()) {}

  /// Calls f(slot) for every slot: reserve memory here, before the threads start.
  template <class F>
  void for_each_slot(F&& f) {
    for (T& slot : *slots_) f(slot);
  }

  /// Producer: the next free slot, or null when all N wait for the consumer. Claiming again without publish() gives the
  /// same slot.
  [[nodiscard]] T* claim() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head - cached_tail_ == N) {
      cached_tail_ = tail_.load(std::memory_order_acquire);  // (B) acquire: the consumer is done with the slot it freed
      if (head - cached_tail_ == N) return nullptr;
    }
    return &(*slots_)[head & (N - 1)];
  }
  /// Producer: hands the claimed slot over.
  void publish() noexcept {
    // (A) release: pairs with the acquire in front(); the slot must be visible before the index.
    head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  /// Consumer: the oldest published slot, or null when there is none.
  [[nodiscard]] T* front() noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (cached_head_ == tail) {
      cached_head_ = head_.load(std::memory_order_acquire);  // (A) acquire: see the slot that the index stands for
      if (cached_head_ == tail) return nullptr;
    }
    return &(*slots_)[tail & (N - 1)];
  }
  /// Consumer: gives the front slot back.
  void pop() noexcept {
    // (B) release: pairs with the acquire in claim(); our reads of the slot end before the producer may write it.
    tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  /// Either side: how many slots wait for the consumer; exact only for the caller's own end.
  [[nodiscard]] std::size_t size() const noexcept {
    const std::size_t tail = tail_.load(std::memory_order_acquire);
    return head_.load(std::memory_order_acquire) - tail;
  }
  [[nodiscard]] static constexpr std::size_t capacity() { return N; }

 private:
  std::unique_ptr<std::array<T, N>> slots_;
  // One cache line per writer: 64 is right on x86-64 and arm64 (the standard constant warns in GCC 12).
  alignas(64) std::atomic<std::size_t> head_{0};
  std::size_t cached_tail_ = 0;  ///< producer's last look at tail_
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::size_t cached_head_ = 0;  ///< consumer's last look at head_
};

}  // namespace roadvec
