#include "drivers/velodyne/udp_receiver.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

namespace roadvec {

Expected<std::unique_ptr<UdpReceiver>> UdpReceiver::open(const UdpReceiverOptions& options, LidarCounters& counters) {
  // A byte more than a packet: a longer datagram must not pass for one.
  Expected<DatagramSocket> data = DatagramSocket::open({.port = options.port,
                                                        .receive_buffer_bytes = options.receive_buffer_bytes,
                                                        .adopted_fd = options.adopted_fd,
                                                        .most_bytes = kPacketBytes + 1,
                                                        .batch = kBatchPackets});
  if (!data) return tl::unexpected(data.error());
  counters.before_start.add(data->before_start_count());
  std::optional<DatagramSocket> position;
  std::string warning;
  if (options.position_port != 0) {
    Expected<DatagramSocket> opened = DatagramSocket::open({.port = options.position_port,
                                                            .adopted_fd = options.adopted_position_fd,
                                                            .most_bytes = kPositionPacketBytes + 1,
                                                            .batch = kBatchPositions});
    if (opened)
      position.emplace(std::move(*opened));
    else
      warning = "no position packets: " + opened.error().message;
  }
  auto receiver =
      std::unique_ptr<UdpReceiver>(new UdpReceiver(std::move(*data), std::move(position), options, counters));
  receiver->warning_ = std::move(warning);
  return receiver;
}

UdpReceiver::UdpReceiver(DatagramSocket data, std::optional<DatagramSocket> position, const UdpReceiverOptions& options,
                         LidarCounters& counters)
    : data_(std::move(data)),
      position_(std::move(position)),
      counters_(counters),
      source_ipv4_(options.source_ipv4),
      senders_(options.source_ipv4),
      packets_(kBatchPackets),
      positions_(kBatchPositions) {}

ReadResult UdpReceiver::read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept {
  batch = {};
  packet_count_ = position_count_ = 0;
  std::array<pollfd, 2> waiting{pollfd{.fd = data_.fd(), .events = POLLIN, .revents = 0},
                                pollfd{.fd = position_ ? position_->fd() : -1, .events = POLLIN, .revents = 0}};
  const int ready = ::poll(waiting.data(), waiting.size(), static_cast<int>(timeout.count()));
  if (ready == 0 || (ready < 0 && errno == EINTR)) return ReadResult::quiet;
  if (ready < 0) {
    fail_with_errno(port(), "poll", errno);
    return ReadResult::failed;
  }
  if (waiting[0].revents != 0 && !receive_data()) return ReadResult::failed;
  if (waiting[1].revents != 0 && !receive_positions()) return ReadResult::failed;
  batch = {packets_.data(), packet_count_};
  return packet_count_ + position_count_ > 0 ? ReadResult::packets : ReadResult::quiet;
}

bool UdpReceiver::receive_data() noexcept {
  int error = 0;
  for (const Datagram& datagram : data_.receive(error)) {
    if (source_ipv4_ && !senders_.ours(datagram.source_ipv4)) {
      // Noted all the same: the status can then say who does send.
      if (datagram.length == kPacketBytes) static_cast<void>(senders_.take(datagram.source_ipv4));
      counters_.foreign_source.add();
    } else if (datagram.length != kPacketBytes) {
      counters_.wrong_length.add();
    } else if (!senders_.take(datagram.source_ipv4)) {
      counters_.foreign_source.add();
    } else {
      counters_.received.add();
      RawPacket& packet = packets_[packet_count_++];
      packet.arrived = datagram.arrived;
      packet.source_ipv4 = datagram.source_ipv4;
      std::copy_n(datagram.bytes.begin(), kPacketBytes, packet.bytes.begin());
    }
  }
  counters_.kernel_drops.add(data_.take_drops());
  if (error != 0) fail_with_errno(port(), "recvmmsg", error);
  return error == 0;
}

bool UdpReceiver::receive_positions() noexcept {
  int error = 0;
  for (const Datagram& datagram : position_->receive(error)) {
    if (!senders_.ours(datagram.source_ipv4)) {
      counters_.foreign_source.add();
    } else if (datagram.length != kPositionPacketBytes) {
      counters_.position_wrong_length.add();
    } else {
      counters_.position_packets.add();
      RawPositionPacket& packet = positions_[position_count_++];
      packet.arrived = datagram.arrived;
      packet.source_ipv4 = datagram.source_ipv4;
      std::copy_n(datagram.bytes.begin(), kPositionPacketBytes, packet.bytes.begin());
    }
  }
  if (error != 0) fail_with_errno(position_port(), "recvmmsg", error);
  return error == 0;
}

void UdpReceiver::fail_with_errno(int port, const char* call, int error) noexcept {
  const int length = std::snprintf(error_text_.data(), error_text_.size(),
                                   "UDP port %d: %s failed (errno %d); restart the receiver", port, call, error);
  error_ = {error_text_.data(),
            static_cast<std::size_t>(std::clamp(length, 0, static_cast<int>(error_text_.size()) - 1))};
}

}  // namespace roadvec
