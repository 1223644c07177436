#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "drivers/can/socketcan_reader.h"

namespace roadvec {
namespace {

constexpr int kReceiveBufferBytes = 1 << 20;

/// Exactly the data frames of one id: the flags are part of what is compared. [linux/can.h]
can_filter filter_of(const CanId& id) {
  if (id.extended) return {.can_id = id.id | CAN_EFF_FLAG, .can_mask = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_EFF_MASK};
  return {.can_id = id.id, .can_mask = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_SFF_MASK};
}

bool set_option(int fd, int level, int name, int value) {
  return ::setsockopt(fd, level, name, &value, sizeof value) == 0;
}

/// Nothing, or what could not be set.
const char* set_options(int fd, std::span<const CanId> ids) {
  if (!ids.empty()) {
    std::vector<can_filter> filters;
    for (const CanId& id : ids) filters.push_back(filter_of(id));
    const auto bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
    if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), bytes) != 0) return "CAN_RAW_FILTER";
  }
  if (!set_option(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, CAN_ERR_MASK)) return "CAN_RAW_ERR_FILTER";
  if (!set_option(fd, SOL_SOCKET, SO_TIMESTAMPNS, 1)) return "SO_TIMESTAMPNS";
  if (!set_option(fd, SOL_SOCKET, SO_RXQ_OVFL, 1)) return "SO_RXQ_OVFL";
  // Kernels without CAN FD still give classic frames. Without CAP_NET_ADMIN the buffer ends at net.core.rmem_max.
  static_cast<void>(set_option(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1));
  if (!set_option(fd, SOL_SOCKET, SO_RCVBUFFORCE, kReceiveBufferBytes)) {
    static_cast<void>(set_option(fd, SOL_SOCKET, SO_RCVBUF, kReceiveBufferBytes));
  }
  return nullptr;
}

std::string remedy(int error, const std::string& interface) {
  switch (error) {
    case EAFNOSUPPORT:
    case EPROTONOSUPPORT:
      return "this kernel has no CAN: load the modules can and can_raw (modprobe can_raw), or use a kernel with "
             "CONFIG_CAN";
    case ENODEV:
    case ENXIO:
      return "there is no such interface: see 'ip link show type can'; a car's bus is brought up with 'ip link set " +
             interface + " up type can bitrate 500000 listen-only on'";
    case EPERM:
    case EACCES:
      return "permission denied: allow the address family AF_CAN to this process";
    default:
      return std::strerror(error);
  }
}

}  // namespace

Expected<int> open_can_socket(const std::string& interface, std::span<const CanId> ids) {
  const std::string what = "cannot read the CAN interface " + interface + ": ";
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (fd < 0) return fail(what + remedy(errno, interface));
  const unsigned index = ::if_nametoindex(interface.c_str());
  const char* refused = index == 0 ? nullptr : set_options(fd, ids);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(index);
  const bool bound =
      index != 0 && refused == nullptr && ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  if (bound) return fd;
  const int error = index == 0 ? ENODEV : errno;
  ::close(fd);
  if (refused != nullptr) return fail(what + "the kernel refuses " + refused + ": " + std::strerror(error));
  return fail(what + remedy(error, interface));
}

}  // namespace roadvec
