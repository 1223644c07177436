#pragma once

#include <chrono>
#include <utility>

namespace roadvec {

/// Wakes a thread that waits for something in a ring: an eventfd. ring() may be called by any thread; it never blocks.
class Doorbell {
 public:
  Doorbell();  ///< throws when the process is out of file descriptors
  ~Doorbell();
  Doorbell(const Doorbell&) = delete;
  Doorbell& operator=(const Doorbell&) = delete;

  void ring() noexcept;
  /// Until rung since the last wait, or the time is over. Rings in between are one.
  void wait(std::chrono::milliseconds timeout) noexcept;

 private:
  int fd_;
};

}  // namespace roadvec
