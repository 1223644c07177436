#include "drivers/velodyne/udp_receiver.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

namespace roadvec {
namespace {

/// Closes on every way out of open() but the last.
class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() {
    if (fd_ >= 0) ::close(fd_);
  }
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;
  [[nodiscard]] int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

tl::unexpected<Error> fail_at_port(int port, const std::string& what) {
  return fail("UDP port " + std::to_string(port) + ": " + what);
}

Expected<int> bound_socket(int port) {
  Fd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (fd.get() < 0) return fail_at_port(port, std::string("cannot open a socket (") + std::strerror(errno) + ")");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_ANY);
  // No SO_REUSEADDR: two sockets on one port would steal each other's packets, and nobody would be told.
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    if (errno == EADDRINUSE) {
      return fail_at_port(port, "already in use; stop the other receiver (ss -lunp shows it) or set another `port`");
    }
    return fail_at_port(port, std::string("cannot bind (") + std::strerror(errno) + "); set another `port`");
  }
  return fd.release();
}

/// Asks past the system's limit where that is allowed; the kernel doubles what it grants, so half is what was asked.
int set_receive_buffer(int fd, int bytes) {
  if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0) {
    ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
  }
  int granted = 0;
  socklen_t length = sizeof granted;
  ::getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &length);
  return granted / 2;
}

int port_of(int fd) {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(address.sin_port);
}

}  // namespace

struct UdpReceiver::Slots {
  /// A datagram longer than a data packet spills here, so that it cannot pass for one.
  static constexpr std::size_t kSpillBytes = 8;
  static constexpr std::size_t kControlBytes = CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t));

  std::array<RawPacket, kBatchPackets> packets{};
  std::array<std::array<std::uint8_t, kSpillBytes>, kBatchPackets> spills{};
  struct alignas(cmsghdr) Control {
    std::array<std::uint8_t, kControlBytes> bytes;
  };
  std::array<Control, kBatchPackets> controls{};
  std::array<sockaddr_in, kBatchPackets> senders{};
  std::array<std::array<iovec, 2>, kBatchPackets> parts{};
  std::array<mmsghdr, kBatchPackets> messages{};

  /// The kernel overwrites lengths and flags, so every header is set again before each call.
  void reset() noexcept {
    for (std::size_t i = 0; i < kBatchPackets; ++i) {
      parts[i] = {iovec{packets[i].bytes.data(), kPacketBytes}, iovec{spills[i].data(), kSpillBytes}};
      messages[i] = {};
      messages[i].msg_hdr.msg_name = &senders[i];
      messages[i].msg_hdr.msg_namelen = sizeof senders[i];
      messages[i].msg_hdr.msg_iov = parts[i].data();
      messages[i].msg_hdr.msg_iovlen = parts[i].size();
      messages[i].msg_hdr.msg_control = controls[i].bytes.data();
      messages[i].msg_hdr.msg_controllen = kControlBytes;
    }
  }
};

Expected<std::unique_ptr<UdpReceiver>> UdpReceiver::open(const UdpReceiverOptions& options, LidarCounters& counters) {
  const Expected<int> socket = options.adopted_fd >= 0 ? Expected<int>(options.adopted_fd) : bound_socket(options.port);
  if (!socket) return tl::unexpected(socket.error());
  Fd fd(*socket);
  int type = 0;
  socklen_t length = sizeof type;
  if (::getsockopt(fd.get(), SOL_SOCKET, SO_TYPE, &type, &length) != 0 || type != SOCK_DGRAM) {
    return fail("the socket handed over for the LiDAR is not a UDP socket; check ListenDatagram= of the socket unit");
  }
  const int on = 1;
  if (::setsockopt(fd.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0 ||
      ::setsockopt(fd.get(), SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0) {
    return fail_at_port(port_of(fd.get()),
                        std::string("no kernel stamps or drop count (") + std::strerror(errno) + ")");
  }
  return std::unique_ptr<UdpReceiver>(new UdpReceiver(fd.release(), options, counters));
}

UdpReceiver::UdpReceiver(int fd, const UdpReceiverOptions& options, LidarCounters& counters)
    : fd_(fd),
      port_(port_of(fd)),
      receive_buffer_bytes_(set_receive_buffer(fd, options.receive_buffer_bytes)),
      source_ipv4_(options.source_ipv4),
      counters_(counters),
      slots_(std::make_unique<Slots>()) {}

UdpReceiver::~UdpReceiver() { ::close(fd_); }

ReadResult UdpReceiver::read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept {
  batch = {};
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, static_cast<int>(timeout.count()));
  if (ready == 0 || (ready < 0 && errno == EINTR)) return ReadResult::quiet;
  if (ready < 0) {
    fail_with_errno("poll");
    return ReadResult::failed;
  }
  slots_->reset();
  // recvmmsg looks at its own timeout only after each datagram, so waiting is poll's work.
  const int count = ::recvmmsg(fd_, slots_->messages.data(), kBatchPackets, MSG_DONTWAIT | MSG_TRUNC, nullptr);
  if (count < 0) {
    if (errno == EAGAIN || errno == EINTR) return ReadResult::quiet;
    fail_with_errno("recvmmsg");
    return ReadResult::failed;
  }
  std::size_t taken_count = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    if (!accept(i)) continue;
    if (taken_count != i) slots_->packets[taken_count] = slots_->packets[i];
    ++taken_count;
  }
  batch = {slots_->packets.data(), taken_count};
  return taken_count > 0 ? ReadResult::packets : ReadResult::quiet;
}

/// Reads stamp, sender and drop count of one datagram; false: not a data packet of our sensor (counted).
bool UdpReceiver::accept(std::size_t slot) noexcept {
  mmsghdr& message = slots_->messages[slot];
  RawPacket& packet = slots_->packets[slot];
  packet.arrived = {};
  for (cmsghdr* control = CMSG_FIRSTHDR(&message.msg_hdr); control != nullptr;
       control = CMSG_NXTHDR(&message.msg_hdr, control)) {
    if (control->cmsg_level != SOL_SOCKET) continue;
    if (control->cmsg_type == SCM_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(control), sizeof stamp);
      packet.arrived = {static_cast<std::int64_t>(stamp.tv_sec) * 1'000'000'000 + stamp.tv_nsec};
    } else if (control->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t total = 0;
      std::memcpy(&total, CMSG_DATA(control), sizeof total);
      counters_.kernel_drops.add(total - kernel_drop_total_);  // unsigned: right across the kernel's wrap
      kernel_drop_total_ = total;
    }
  }
  packet.source_ipv4 = ntohl(slots_->senders[slot].sin_addr.s_addr);
  if (source_ipv4_ && packet.source_ipv4 != *source_ipv4_) {
    counters_.foreign_source.add();
    return false;
  }
  // MSG_TRUNC makes msg_len the datagram's true length.
  if (message.msg_len != kPacketBytes) {
    counters_.wrong_length.add();
    return false;
  }
  counters_.received.add();
  return true;
}

void UdpReceiver::fail_with_errno(const char* call) noexcept {
  const int length = std::snprintf(error_text_.data(), error_text_.size(),
                                   "UDP port %d: %s failed (errno %d); restart the receiver", port_, call, errno);
  error_ = {error_text_.data(),
            static_cast<std::size_t>(std::clamp(length, 0, static_cast<int>(error_text_.size()) - 1))};
}

}  // namespace roadvec
