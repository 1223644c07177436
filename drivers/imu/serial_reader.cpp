#include "drivers/imu/serial_reader.h"

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace roadvec {
namespace {

struct Speed {
  unsigned baud;
  speed_t code;
};
constexpr auto kSpeeds = std::to_array<Speed>({{9600, B9600},
                                               {19200, B19200},
                                               {38400, B38400},
                                               {57600, B57600},
                                               {115200, B115200},
                                               {230400, B230400},
                                               {460800, B460800},
                                               {921600, B921600},
                                               {2000000, B2000000}});

Expected<speed_t> speed_of(unsigned baud) {
  std::string known;
  for (const Speed& speed : kSpeeds) {
    if (speed.baud == baud) return speed.code;
    known += (known.empty() ? "" : ", ") + std::to_string(speed.baud);
  }
  return fail(std::to_string(baud) + " baud is not offered; one of " + known);
}

std::string remedy(int error) {
  switch (error) {
    case ENOENT:
      return "there is no such device: see /dev/serial/by-id, and whether it is plugged in";
    case EACCES:
      return "permission denied: give this user the group 'dialout'";
    case ENOTTY:
      return "it is not a serial line";
    default:
      return std::strerror(error);
  }
}

Expected<int> open_serial(const std::string& path, unsigned baud) {
  const std::string what = "cannot read the serial device " + path + ": ";
  const Expected<speed_t> speed = speed_of(baud);
  if (!speed) return fail(what + speed.error().message);
  // O_NONBLOCK: opening must not wait for a carrier.
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return fail(what + remedy(errno));
  termios line{};
  bool set = ::tcgetattr(fd, &line) == 0;
  if (set) {
    ::cfmakeraw(&line);
    line.c_cflag |= CLOCAL | CREAD;
    line.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
    line.c_cc[VMIN] = 1;
    line.c_cc[VTIME] = 0;
    set = ::cfsetspeed(&line, *speed) == 0 && ::tcsetattr(fd, TCSANOW, &line) == 0;
  }
  if (set) return fd;
  const int error = errno;
  ::close(fd);
  return fail(what + remedy(error));
}

}  // namespace

Expected<std::unique_ptr<SerialReader>> SerialReader::open(const std::string& path, unsigned baud) {
  const Expected<int> fd = open_serial(path, baud);
  if (!fd) return fail(fd.error().message);
  return std::unique_ptr<SerialReader>(new SerialReader(path, baud, *fd));
}

SerialReader::~SerialReader() {
  if (fd_ >= 0) ::close(fd_);
}

ImuReadResult SerialReader::read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept {
  if (fd_ < 0) {
    wait_and_reopen(timeout);
    return ImuReadResult::quiet;
  }
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, static_cast<int>(timeout.count()));
  if (ready < 0) return errno == EINTR ? ImuReadResult::quiet : ImuReadResult::failed;
  if (ready == 0) return ImuReadResult::quiet;
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const ssize_t count = ::read(fd_, buffer_.data(), buffer_.size());
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return ImuReadResult::quiet;
  // A line that is hung up reads as an end of file; one whose adapter was pulled fails (EIO, ENXIO, ENODEV).
  if (count <= 0) {
    lose_device();
    return ImuReadResult::quiet;
  }
  counters_.byte_count += static_cast<std::uint64_t>(count);
  bytes.time = {static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec};
  bytes.has_time = true;
  bytes.bytes = std::span<const std::uint8_t>(buffer_).first(static_cast<std::size_t>(count));
  return ImuReadResult::bytes;
}

void SerialReader::wait_and_reopen(std::chrono::milliseconds timeout) noexcept {
  // At least 1 ms, so that a caller who never waits does not spin and gets its device back too.
  const std::chrono::milliseconds pause = std::max(timeout, std::chrono::milliseconds{1});
  ::poll(nullptr, 0, static_cast<int>(pause.count()));
  if (!backoff_.due_after(pause)) return;
  const Expected<int> fd = open_serial(path_, baud_);
  if (!fd) return;
  fd_ = *fd;
  backoff_.reset();
  ++counters_.reopened_count;
}

void SerialReader::lose_device() noexcept {
  ++counters_.device_lost_count;
  ::close(fd_);
  fd_ = -1;
}

}  // namespace roadvec
