#include "drivers/imu/udp_reader.h"

#include <poll.h>

#include <cerrno>

namespace roadvec {

Expected<std::unique_ptr<ImuUdpReader>> ImuUdpReader::open(int port, int adopted_fd) {
  Expected<DatagramSocket> socket = DatagramSocket::open({.port = port, .adopted_fd = adopted_fd});
  if (!socket) return fail("IMU: " + socket.error().message);
  return std::unique_ptr<ImuUdpReader>(new ImuUdpReader(std::move(*socket)));
}

ImuReadResult ImuUdpReader::read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept {
  if (waiting_.empty()) {
    pollfd waiting{.fd = socket_.fd(), .events = POLLIN, .revents = 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(timeout.count()));
    if (ready < 0 && errno != EINTR) return ImuReadResult::failed;
    if (ready <= 0) return ImuReadResult::quiet;
    int error = 0;
    waiting_ = socket_.receive(error);
    if (error != 0) return ImuReadResult::failed;
    counters_.kernel_drop_count += socket_.take_drops();
    if (waiting_.empty()) return ImuReadResult::quiet;
  }
  const Datagram& datagram = waiting_.front();
  waiting_ = waiting_.subspan(1);
  counters_.byte_count += datagram.bytes.size();
  bytes = {datagram.arrived, true, datagram.bytes};
  return ImuReadResult::bytes;
}

}  // namespace roadvec
