#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>

#include "core/base/error.h"

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
  /// Reading the configuration again; ready() ends it.
  static void reloading();
  static void stopping();
  /// Feeds the watchdog if the unit has one; call it only when every stage has moved.
  void feed_watchdog() const;

  /// The next of the blocked signals, waiting for `timeout` at most.
  [[nodiscard]] std::optional<int> wait_for_signal(std::chrono::milliseconds timeout) const;

 private:
  bool has_watchdog_ = false;
};

/// The sockets that systemd has opened for us (roadvec-*.socket), so that the service needs no right to open any
/// itself. Who uses one owns it.
struct PassedSockets {
  int map_fd = -1;             ///< the UNIX socket with FileDescriptorName=map; -1: none
  int control_fd = -1;         ///< the one with FileDescriptorName=control; -1: none
  std::map<int, int> udp_fds;  ///< by port: the configuration names ports, so the units need no further names
  [[nodiscard]] int udp_fd(int port) const;  ///< -1: none
};
/// Empty where there is no systemd. Called once: what is handed over is not found again.
[[nodiscard]] Expected<PassedSockets> take_passed_sockets();

}  // namespace roadvec
