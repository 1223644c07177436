#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace roadvec {

/// What systemd is told (sd_notify) and what the process is sent. All calls do nothing where there is no systemd.
class Service {
 public:
  /// Blocks SIGINT, SIGTERM and SIGHUP in this thread and all it starts: make it before the threads.
  Service();

  static void ready();
  /// Not ready yet, and still busy: systemd waits on.
  static void starting(const std::string& line);
  static void status(const std::string& line);
  static void stopping();
  /// Feeds the watchdog if the unit has one; call it only when every stage has moved.
  void feed_watchdog() const;

  /// The next of the blocked signals, waiting for `timeout` at most.
  [[nodiscard]] std::optional<int> wait_for_signal(std::chrono::milliseconds timeout) const;

 private:
  bool has_watchdog_ = false;
};

}  // namespace roadvec
