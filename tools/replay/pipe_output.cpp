#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "tools/replay/output.h"

namespace roadvec {
namespace {

/// Writes all of `bytes`; what does not fit at once is waited for only if `moment` allows.
SendResult write_all(int fd, std::span<const std::uint8_t> bytes, const SendMoment& moment) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(written));
      continue;
    }
    if (written < 0 && errno == EINTR) continue;
    if ((written < 0 && errno != EAGAIN) || !moment.may_wait || moment.stop->load()) return SendResult::lost;
    pollfd room{.fd = fd, .events = POLLOUT, .revents = 0};
    ::poll(&room, 1, 100);
    if ((room.revents & (POLLHUP | POLLERR)) != 0) return SendResult::lost;
  }
  return SendResult::sent;
}

}  // namespace

Expected<PipeOutput> PipeOutput::open(const std::string& path) {
  const bool made = ::mkfifo(path.c_str(), 0660) == 0;
  struct stat status {};
  if (!made && errno != EEXIST)
    return fail("--can-pipe " + path + ": " + std::strerror(errno) + "; name a folder you may write to");
  if (!made && (::stat(path.c_str(), &status) != 0 || !S_ISFIFO(status.st_mode))) {
    return fail("--can-pipe " + path + ": is there and not a FIFO; remove it or name another path");
  }
  return PipeOutput(path, made);
}

PipeOutput::~PipeOutput() {
  if (made_ && !path_.empty()) ::unlink(path_.c_str());  // empty: moved from
}

bool PipeOutput::has_listener() {
  if (fifo_.get() < 0) fifo_ = FileDescriptor(::open(path_.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC));
  return fifo_.get() >= 0;
}

SendResult PipeOutput::send(std::span<const std::uint8_t> bytes, const SendMoment& moment) {
  return has_listener() ? write_all(fifo_.get(), bytes, moment) : SendResult::lost;
}

Expected<PtyOutput> PtyOutput::open(const std::string& path) {
  FileDescriptor terminal(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  std::array<char, 64> name{};
  if (terminal.get() < 0 || ::grantpt(terminal.get()) != 0 || ::unlockpt(terminal.get()) != 0 ||
      ::ptsname_r(terminal.get(), name.data(), name.size()) != 0) {
    return fail("--imu-pty " + path + ": no pseudo-terminal: " + std::strerror(errno) + "; is /dev/pts mounted?");
  }
  {
    // Opened and closed once: raw mode stays, and from now on the kernel tells whether anybody has it open.
    const FileDescriptor line(::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    termios mode{};
    ::tcgetattr(line.get(), &mode);
    ::cfmakeraw(&mode);
    if (::tcsetattr(line.get(), TCSANOW, &mode) != 0)
      return fail("--imu-pty " + path + ": " + std::strerror(errno) + "; run without it");
  }
  struct stat status {};
  if (::lstat(path.c_str(), &status) == 0) {
    if (!S_ISLNK(status.st_mode))
      return fail("--imu-pty " + path + ": is there and not a symbolic link; remove it or name another path");
    ::unlink(path.c_str());  // left over from a replay that was killed
  }
  if (::symlink(name.data(), path.c_str()) != 0) {
    return fail("--imu-pty " + path + ": " + std::strerror(errno) + "; name a folder you may write to");
  }
  return PtyOutput(path, std::move(terminal));
}

PtyOutput::~PtyOutput() {
  if (path_.empty()) return;  // moved from
  if (has_listener()) wait_until_read();
  ::unlink(path_.c_str());
}

/// What is unread is lost when the terminal goes, up to 4 KiB of it. A reader that lives takes it within moments, on a
/// busy machine within seconds; what it has not taken then is told.
void PtyOutput::wait_until_read() const {
  const FileDescriptor line(::open(path_.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  // The kernel hands bytes on to the line a little later, and until then counts them nowhere: empty once is not empty.
  constexpr int kTries = 500, kEmptyTries = 20;
  int unread = 0, empty_tries = 0;
  for (int i = 0; i < kTries && empty_tries < kEmptyTries; ++i) {
    constexpr timespec kPause{.tv_sec = 0, .tv_nsec = 10'000'000};
    ::nanosleep(&kPause, nullptr);
    if (::ioctl(line.get(), FIONREAD, &unread) != 0) return;
    empty_tries = unread > 0 ? 0 : empty_tries + 1;
  }
  if (unread > 0)
    std::fprintf(stderr, "roadvec-replay: %s: the last %d bytes or more were not read\n", path_.c_str(), unread);
}

bool PtyOutput::has_listener() const {
  pollfd line{.fd = terminal_.get(), .events = POLLOUT, .revents = 0};
  ::poll(&line, 1, 0);
  return (line.revents & POLLHUP) == 0;
}

SendResult PtyOutput::send(std::span<const std::uint8_t> bytes, const SendMoment& moment) {
  return has_listener() ? write_all(terminal_.get(), bytes, moment) : SendResult::lost;
}

}  // namespace roadvec
