#include "drivers/udp/datagram_socket.h"

#include <arpa/inet.h>
#include <linux/sock_diag.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>
#include <vector>

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
  if (fd.get() < 0 && errno == EAFNOSUPPORT) {
    return fail_at_port(port,
                        "this service may open no network socket; let systemd hand it over: ListenDatagram=0.0.0.0:" +
                            std::to_string(port) + " in roadvec-lidar.socket");
  }
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

/// The kernel doubles what it grants, so half is what was asked.
int receive_buffer_of(int fd) {
  int granted = 0;
  socklen_t length = sizeof granted;
  ::getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &length);
  return granted / 2;
}

/// Asks past the system's limit where that is allowed.
int set_receive_buffer(int fd, int bytes, bool adopted) {
  // One handed over was made larger than we may ask for ourselves: to ask would cut it down to net.core.rmem_max.
  if (adopted && receive_buffer_of(fd) >= bytes) return receive_buffer_of(fd);
  if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0 && !adopted) {
    ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
  }
  return receive_buffer_of(fd);
}

/// What the kernel has thrown away since the socket was made.
std::uint32_t drop_total_of(int fd) {
  std::array<std::uint32_t, SK_MEMINFO_VARS> figures{};
  socklen_t length = sizeof figures;
  return ::getsockopt(fd, SOL_SOCKET, SO_MEMINFO, figures.data(), &length) == 0 ? figures[SK_MEMINFO_DROPS] : 0;
}

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);  // the clock of the kernel's stamps
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

int port_of(int fd) {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  return ntohs(address.sin_port);
}

}  // namespace

struct DatagramSocket::Slots {
  static constexpr std::size_t kControlBytes = CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t));
  struct alignas(cmsghdr) Control {
    std::array<std::uint8_t, kControlBytes> bytes;
  };

  Slots(std::size_t count, std::size_t most)
      : most_bytes(most),
        bytes(count * most),
        controls(count),
        senders(count),
        parts(count),
        messages(count),
        datagrams(count) {}

  /// The kernel overwrites lengths and flags, so every header is set again before each call.
  void reset() noexcept {
    for (std::size_t i = 0; i < messages.size(); ++i) {
      parts[i] = {bytes.data() + i * most_bytes, most_bytes};
      messages[i] = {};
      messages[i].msg_hdr.msg_name = &senders[i];
      messages[i].msg_hdr.msg_namelen = sizeof senders[i];
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = controls[i].bytes.data();
      messages[i].msg_hdr.msg_controllen = kControlBytes;
    }
  }

  std::size_t most_bytes;
  std::vector<std::uint8_t> bytes;
  std::vector<Control> controls;
  std::vector<sockaddr_in> senders;
  std::vector<iovec> parts;
  std::vector<mmsghdr> messages;
  std::vector<Datagram> datagrams;
};

Expected<DatagramSocket> DatagramSocket::open(const DatagramSocketOptions& options) {
  const Expected<int> socket = options.adopted_fd >= 0 ? Expected<int>(options.adopted_fd) : bound_socket(options.port);
  if (!socket) return tl::unexpected(socket.error());
  Fd fd(*socket);
  int type = 0;
  socklen_t length = sizeof type;
  if (::getsockopt(fd.get(), SOL_SOCKET, SO_TYPE, &type, &length) != 0 || type != SOCK_DGRAM) {
    return fail("the socket handed over is not a UDP socket; check ListenDatagram= of the socket unit");
  }
  const int on = 1;
  if (::setsockopt(fd.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0 ||
      ::setsockopt(fd.get(), SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0) {
    return fail_at_port(port_of(fd.get()),
                        std::string("no kernel stamps or drop count (") + std::strerror(errno) + ")");
  }
  DatagramSocket opened(fd.release(), options);
  if (options.adopted_fd >= 0) opened.forget_the_past();
  return opened;
}

DatagramSocket::DatagramSocket(int fd, const DatagramSocketOptions& options)
    : fd_(fd),
      port_(port_of(fd)),
      receive_buffer_bytes_(set_receive_buffer(fd, options.receive_buffer_bytes, options.adopted_fd >= 0)),
      slots_(std::make_unique<Slots>(options.batch, options.most_bytes)) {}

DatagramSocket::DatagramSocket(DatagramSocket&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      port_(other.port_),
      receive_buffer_bytes_(other.receive_buffer_bytes_),
      drop_total_(other.drop_total_),
      drops_taken_(other.drops_taken_),
      before_start_count_(other.before_start_count_),
      slots_(std::move(other.slots_)) {}

DatagramSocket::~DatagramSocket() {
  if (fd_ >= 0) ::close(fd_);
}

std::span<const Datagram> DatagramSocket::receive(int& error) noexcept {
  error = 0;
  slots_->reset();
  // MSG_TRUNC makes msg_len the datagram's true length. recvmmsg looks at its own timeout only after each datagram, so
  // waiting is the caller's work, by poll.
  const int count = ::recvmmsg(fd_, slots_->messages.data(), static_cast<unsigned>(slots_->messages.size()),
                               MSG_DONTWAIT | MSG_TRUNC, nullptr);
  if (count < 0) {
    if (errno != EAGAIN && errno != EINTR) error = errno;
    return {};
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) read_controls(i);
  return std::span(slots_->datagrams).first(static_cast<std::size_t>(count));
}

void DatagramSocket::read_controls(std::size_t slot) noexcept {
  mmsghdr& message = slots_->messages[slot];
  Datagram& datagram = slots_->datagrams[slot];
  datagram.arrived = {};
  for (cmsghdr* control = CMSG_FIRSTHDR(&message.msg_hdr); control != nullptr;
       control = CMSG_NXTHDR(&message.msg_hdr, control)) {
    if (control->cmsg_level != SOL_SOCKET) continue;
    if (control->cmsg_type == SCM_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(control), sizeof stamp);
      datagram.arrived = {static_cast<std::int64_t>(stamp.tv_sec) * 1'000'000'000 + stamp.tv_nsec};
    } else if (control->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&drop_total_, CMSG_DATA(control), sizeof drop_total_);
    }
  }
  datagram.source_ipv4 = ntohl(slots_->senders[slot].sin_addr.s_addr);
  datagram.length = message.msg_len;
  datagram.bytes = {slots_->bytes.data() + slot * slots_->most_bytes,
                    std::min<std::size_t>(message.msg_len, slots_->most_bytes)};
}

/// An adopted socket may have been filling for hours. Nobody kept the other sensors' data of that time, so its
/// datagrams are of no use, and its drops are not ours.
void DatagramSocket::forget_the_past() noexcept {
  const std::uint32_t drop_total = drop_total_of(fd_);
  const std::int64_t begin_ns = now_ns();
  int error = 0;
  for (auto queued = receive(error); !queued.empty(); queued = receive(error)) {
    before_start_count_ += queued.size();
    if (queued.back().arrived.ns > begin_ns) break;  // the sender does not pause for us
  }
  drop_total_ = drops_taken_ = drop_total;
}

std::uint32_t DatagramSocket::take_drops() noexcept {
  const std::uint32_t drops = drop_total_ - drops_taken_;  // unsigned: right across the kernel's wrap
  drops_taken_ = drop_total_;
  return drops;
}

}  // namespace roadvec
