#include "daemon/stages/doorbell.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

namespace roadvec {

Doorbell::Doorbell() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

Doorbell::~Doorbell() { ::close(fd_); }

void Doorbell::ring() noexcept {
  const std::uint64_t one = 1;
  // Full means that it rings already.
  static_cast<void>(!::write(fd_, &one, sizeof one));
}

void Doorbell::wait(std::chrono::milliseconds timeout) noexcept {
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  if (::poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0) return;
  std::uint64_t rings = 0;
  static_cast<void>(!::read(fd_, &rings, sizeof rings));
}

}  // namespace roadvec
