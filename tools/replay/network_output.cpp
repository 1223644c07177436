#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <netdb.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>

#include "tools/replay/output.h"

namespace roadvec {

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) ::close(fd_);
}

Expected<Endpoint> Endpoint::parse(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  Endpoint endpoint;
  if (colon != std::string::npos) {
    endpoint.host = text.substr(0, colon);
    const char* const end = text.data() + text.size();
    const auto [parsed, error] = std::from_chars(text.data() + colon + 1, end, endpoint.port);
    if (error != std::errc() || parsed != end) endpoint.port = 0;
  }
  if (endpoint.host.starts_with('[') && endpoint.host.ends_with(']')) {
    endpoint.host = endpoint.host.substr(1, endpoint.host.size() - 2);
  }
  if (endpoint.host.empty() || endpoint.port < 1 || endpoint.port > 65535) {
    return fail("'" + text + "' is not HOST:PORT; for example 127.0.0.1:2368");
  }
  return endpoint;
}

Expected<UdpOutput> UdpOutput::open(const Endpoint& to) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(to.host.c_str(), std::to_string(to.port).c_str(), &hints, &found); error != 0) {
    return fail(to.text() + ": " + ::gai_strerror(error) + "; check the host's name");
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, ::freeaddrinfo);
  UdpOutput output(::socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const int on = 1;
  // A head that was never told its host's address broadcasts; replay may do the same.
  ::setsockopt(output.socket_.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
  if (output.socket_.get() < 0 || ::connect(output.socket_.get(), found->ai_addr, found->ai_addrlen) != 0) {
    return fail(to.text() + ": cannot send there: " + std::strerror(errno) + "; check address and route");
  }
  return output;
}

SendResult UdpOutput::send(std::span<const std::uint8_t> datagram) {
  ssize_t sent = ::send(socket_.get(), datagram.data(), datagram.size(), 0);
  if (sent >= 0) return SendResult::sent;
  // The refusal belongs to an earlier datagram and kept this one from leaving: that one is lost, this one goes now.
  if (errno == ECONNREFUSED) ::send(socket_.get(), datagram.data(), datagram.size(), 0);
  return SendResult::lost;
}

Expected<CanOutput> CanOutput::open(const std::string& interface) {
  CanOutput output(::socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW));
  const int fd = output.socket_.get();
  if (fd < 0 && errno == EAFNOSUPPORT) {
    return fail("--can " + interface +
                ": this kernel has no CAN (AF_CAN); load the modules can and can_raw, or run without --can"
                " (--can-pipe needs no CAN)");
  }
  if (fd < 0) return fail("--can " + interface + ": no CAN socket: " + std::strerror(errno) + "; run without --can");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) {
    return fail("--can " + interface + ": no such interface; for a virtual one: ip link add " + interface +
                " type vcan && ip link set " + interface + " up");
  }
  const int on = 1;
  ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on,
               sizeof on);  // an interface without FD refuses those frames one by one
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return fail("--can " + interface + ": " + std::strerror(errno) + "; is it a CAN interface that is up?");
  }
  return output;
}

SendResult CanOutput::send(const CanFrame& frame, const SendMoment& moment) {
  canfd_frame wire{};
  static_assert(CAN_MTU == offsetof(canfd_frame, data) + CAN_MAX_DLEN);  // a classic frame is the front of an FD frame
  wire.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
  wire.len = frame.length;
  std::copy_n(frame.data.begin(), frame.length, wire.data);
  const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
  while (::write(socket_.get(), &wire, size) != static_cast<ssize_t>(size)) {
    const bool full = errno == ENOBUFS || errno == EAGAIN;
    if (!full || !moment.may_wait || moment.stop->load()) return SendResult::lost;
    const timespec pause{.tv_sec = 0, .tv_nsec = 200'000};  // poll() does not wake for a full transmit queue
    ::nanosleep(&pause, nullptr);
  }
  return SendResult::sent;
}

}  // namespace roadvec
