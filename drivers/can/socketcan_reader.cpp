#include "drivers/can/socketcan_reader.h"

#include <linux/can.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace roadvec {
namespace {

SensorTime time_of(const timespec& stamp) {
  return {static_cast<std::int64_t>(stamp.tv_sec) * 1'000'000'000 + stamp.tv_nsec};
}

/// can_frame and canfd_frame share their layout up to the data; false: a length that the frame cannot have.
bool unpack(const canfd_frame& raw, bool fd, CanFrame& frame) {
  if (raw.len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) return false;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.extended = !frame.error && (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = !frame.error && (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.id = raw.can_id & (frame.error || frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.length = raw.len;
  frame.interface = 0;
  frame.data.fill(0);
  if (!frame.remote) std::copy_n(raw.data, raw.len, frame.data.begin());
  return true;
}

}  // namespace

Expected<std::unique_ptr<SocketCanReader>> SocketCanReader::open(const std::string& interface,
                                                                 std::span<const CanId> ids, const CanSystem& system) {
  const Expected<int> fd = system.open(interface, ids);
  if (!fd) return fail(fd.error().message);
  return std::unique_ptr<SocketCanReader>(new SocketCanReader(interface, ids, system, *fd));
}

SocketCanReader::SocketCanReader(const std::string& interface, std::span<const CanId> ids, const CanSystem& system,
                                 int fd)
    : interface_(interface), ids_(ids.begin(), ids.end()), system_(system) {
  use(fd);
}

SocketCanReader::~SocketCanReader() { close(); }

std::string_view SocketCanReader::interface_name(std::uint8_t interface) const noexcept {
  return interface == 0 ? std::string_view(interface_) : std::string_view();
}

CanReadResult SocketCanReader::read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept {
  if (fd_ < 0) {
    wait_and_reopen(timeout);
    return CanReadResult::quiet;
  }
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, static_cast<int>(timeout.count()));
  if (ready < 0) return errno == EINTR ? CanReadResult::quiet : CanReadResult::failed;
  if (ready == 0) return CanReadResult::quiet;
  return receive(frame);
}

void SocketCanReader::use(int fd) noexcept {
  fd_ = fd;
  socket_drops_ = 0;
  int bytes = 0;
  socklen_t size = sizeof bytes;
  if (::getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, &size) == 0)
    counters_.receive_buffer_bytes = static_cast<std::uint64_t>(bytes);
  counters_.state = CanState::working;
}

void SocketCanReader::wait_and_reopen(std::chrono::milliseconds timeout) noexcept {
  // At least 1 ms, so that a caller who never waits does not spin and gets its device back too.
  const std::chrono::milliseconds pause = std::max(timeout, std::chrono::milliseconds{1});
  ::poll(nullptr, 0, static_cast<int>(pause.count()));
  if (!backoff_.due_after(pause)) return;
  const Expected<int> fd = system_.open(interface_, ids_);
  if (!fd) return;
  use(*fd);
  backoff_.reset();
  ++counters_.reopened_count;
}

CanReadResult SocketCanReader::receive(CanFrame& frame) noexcept {
  canfd_frame raw{};
  iovec piece{.iov_base = &raw, .iov_len = sizeof raw};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))> control{};
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = system_.receive(fd_, &message, MSG_DONTWAIT | MSG_TRUNC);
  if (size < 0) return on_error(errno);
  note_control_messages(message, frame);
  const bool fd = size == CANFD_MTU;
  if ((!fd && size != CAN_MTU) || !unpack(raw, fd, frame)) {
    ++counters_.wrong_size_count;
    return CanReadResult::quiet;
  }
  ++counters_.frame_count;
  if (frame.error) {
    count_error_frame(frame, counters_);
  } else {
    counters_.state = CanState::working;  // a controller that was restarted by hand may not say so
  }
  return CanReadResult::frame;
}

void SocketCanReader::note_control_messages(msghdr& message, CanFrame& frame) noexcept {
  bool stamped = false;
  for (cmsghdr* item = CMSG_FIRSTHDR(&message); item != nullptr; item = CMSG_NXTHDR(&message, item)) {
    if (item->cmsg_level != SOL_SOCKET) continue;
    if (item->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(item), sizeof stamp);
      frame.time = time_of(stamp);
      stamped = true;
    } else if (item->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t total = 0;
      std::memcpy(&total, CMSG_DATA(item), sizeof total);
      counters_.kernel_drop_count += total - socket_drops_;  // the socket's count wraps at 32 bits, as this does
      socket_drops_ = total;
    }
  }
  if (stamped) return;
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  frame.time = time_of(now);
}

CanReadResult SocketCanReader::on_error(int error) noexcept {
  switch (error) {
    case EAGAIN:
    case EINTR:
      return CanReadResult::quiet;
    case ENETDOWN:  // told once; the socket stays bound and delivers again when the interface is up
      ++counters_.interface_down_count;
      counters_.state = CanState::down;
      return CanReadResult::quiet;
    case ENODEV:
    case ENXIO:  // told once; the kernel has unbound the socket for good
      ++counters_.interface_lost_count;
      counters_.state = CanState::lost;
      close();
      return CanReadResult::quiet;
    default:
      return CanReadResult::failed;
  }
}

void SocketCanReader::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

}  // namespace roadvec
