#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <stop_token>

#include "core/ring/spsc_ring.h"
#include "daemon/stages/doorbell.h"

namespace roadvec {

/// How long a thread sleeps at most before it looks whether it is asked to stop.
inline constexpr std::chrono::milliseconds kNap{20};

/// What a producer does when the ring is full.
enum class WhenFull : std::uint8_t {
  refuse,  ///< live input: the newest is refused, and the producer counts it
  wait,    ///< recorded input: the producer waits, nothing is lost
};

/// A ring between two threads, with a doorbell each way and an end.
///
/// Producer: claim(), fill, publish(), at last close(). Consumer: front(), use, pop(); waits on its bell while it is
/// empty; finished() when it is closed and empty.
template <class T, std::size_t N>
class Channel {
 public:
  /// `consumer_bell`: the consumer waits on it, for this channel and any other that it reads.
  Channel(WhenFull when_full, Doorbell& consumer_bell) : when_full_(when_full), filled_(consumer_bell) {}

  template <class F>
  void for_each_slot(F&& f) {
    ring_.for_each_slot(f);
  }

  /// Producer. Null: refused because the ring is full, or asked to stop while waiting.
  [[nodiscard]] T* claim(const std::stop_token& stop) noexcept {
    T* slot = ring_.claim();
    while (slot == nullptr && when_full_ == WhenFull::wait && !stop.stop_requested()) {
      room_.wait(kNap);
      slot = ring_.claim();
    }
    return slot;
  }
  void publish() noexcept {
    ring_.publish();
    filled_.ring();
  }
  /// Producer: nothing more will come.
  void close() noexcept {
    closed_.store(true, std::memory_order_release);  // (A) release: after the last publish()
    filled_.ring();
  }

  /// Consumer: the oldest, or null.
  [[nodiscard]] T* front() noexcept { return ring_.front(); }
  void pop() noexcept {
    ring_.pop();
    if (when_full_ == WhenFull::wait) room_.ring();
  }
  [[nodiscard]] bool closed() const noexcept {
    return closed_.load(
        std::memory_order_acquire);  // (A) acquire: then front() sees everything published before close()
  }
  [[nodiscard]] bool finished() noexcept { return closed() && front() == nullptr; }
  [[nodiscard]] std::size_t size() const noexcept { return ring_.size(); }
  [[nodiscard]] WhenFull when_full() const noexcept { return when_full_; }

 private:
  SpscRing<T, N> ring_;
  WhenFull when_full_;
  std::atomic<bool> closed_{false};
  Doorbell& filled_;
  Doorbell room_;
};

}  // namespace roadvec
