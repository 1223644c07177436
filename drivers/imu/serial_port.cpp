#include "drivers/imu/serial_port.h"

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

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

}  // namespace

Expected<int> open_serial(const std::string& path, unsigned baud, SerialUse use) {
  const std::string what = "cannot read the serial device " + path + ": ";
  const Expected<speed_t> speed = speed_of(baud);
  if (!speed) return fail(what + speed.error().message);
  // O_NONBLOCK: opening must not wait for a carrier.
  const int fd = ::open(path.c_str(), (use == SerialUse::read ? O_RDONLY : O_RDWR) | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
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

}  // namespace roadvec
