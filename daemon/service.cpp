#include "daemon/service.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <systemd/sd-daemon.h>

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>

namespace roadvec {
namespace {

sigset_t handled_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

/// What sd_listen_fds_with_names gives: a list of texts with a null behind the last.
struct NamesDeleter {
  void operator()(char** names) const {
    for (char** name = names; *name != nullptr; ++name) ::free(*name);
    ::free(names);
  }
};

Expected<void> sort_in(int fd, const std::string& name, PassedSockets& sockets) {
  if (::sd_is_socket(fd, AF_UNIX, SOCK_STREAM, 1) > 0) {
    int* const place = name == "map" ? &sockets.map_fd : name == "control" ? &sockets.control_fd : nullptr;
    if (place == nullptr || *place >= 0) {
      return fail("systemd hands over a UNIX socket named '" + name +
                  "'; one is wanted with FileDescriptorName=map in its socket unit, and one with control");
    }
    *place = fd;
    return {};
  }
  sockaddr_in address{};
  socklen_t length = sizeof address;
  // ListenDatagram= without an address gives an IPv6 socket, which names its senders otherwise.
  if (::sd_is_socket(fd, AF_INET, SOCK_DGRAM, -1) <= 0 ||
      ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    return fail("systemd hands over a socket, '" + name +
                "', that is neither the map's (ListenStream=/run/roadvec/map.sock) nor UDP over IPv4 "
                "(ListenDatagram=0.0.0.0:2368); correct its socket unit");
  }
  sockets.udp_fds.emplace(ntohs(address.sin_port), fd);
  return {};
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
void Service::reloading() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  const std::int64_t now_us = static_cast<std::int64_t>(now.tv_sec) * 1'000'000 + now.tv_nsec / 1000;
  // systemd 253 and later want to know that this answers the signal it has just sent.
  ::sd_notify(0, ("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(now_us)).c_str());
}
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

int PassedSockets::udp_fd(int port) const {
  const auto found = udp_fds.find(port);
  return found == udp_fds.end() ? -1 : found->second;
}

Expected<PassedSockets> take_passed_sockets() {
  char** raw_names = nullptr;
  const int count = ::sd_listen_fds_with_names(1, &raw_names);
  const std::unique_ptr<char*, NamesDeleter> names(raw_names);
  if (count < 0) return fail(std::string("sockets from systemd: ") + std::strerror(-count));
  PassedSockets sockets;
  for (int i = 0; i < count; ++i) {
    const auto sorted = sort_in(SD_LISTEN_FDS_START + i, raw_names[i], sockets);
    if (!sorted) return tl::unexpected(sorted.error());
  }
  return sockets;
}

}  // namespace roadvec
