#include "daemon/service.h"

#include <systemd/sd-daemon.h>

#include <csignal>
#include <ctime>

namespace roadvec {
namespace {

sigset_t handled_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

}  // namespace

Service::Service() {
  const sigset_t signals = handled_signals();
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::uint64_t period_us = 0;
  has_watchdog_ = ::sd_watchdog_enabled(0, &period_us) > 0;
}

void Service::ready() { ::sd_notify(0, "READY=1"); }
void Service::starting(const std::string& line) {
  ::sd_notify(0, ("EXTEND_TIMEOUT_USEC=30000000\nSTATUS=" + line).c_str());
}

void Service::status(const std::string& line) { ::sd_notify(0, ("STATUS=" + line).c_str()); }
void Service::stopping() { ::sd_notify(0, "STOPPING=1"); }

void Service::feed_watchdog() const {
  if (has_watchdog_) ::sd_notify(0, "WATCHDOG=1");
}

std::optional<int> Service::wait_for_signal(std::chrono::milliseconds timeout) const {
  const sigset_t signals = handled_signals();
  const timespec limit{.tv_sec = static_cast<std::time_t>(timeout.count() / 1000),
                       .tv_nsec = static_cast<long>(timeout.count() % 1000) * 1'000'000};
  const int signal = ::sigtimedwait(&signals, nullptr, &limit);
  return signal > 0 ? std::optional<int>(signal) : std::nullopt;
}

}  // namespace roadvec
