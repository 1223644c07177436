#include "drivers/velodyne/udp_receiver.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>

#include "tests/drivers/velodyne/packets.h"

namespace roadvec {
namespace {

using testing::HasSubstr;
using namespace std::chrono_literals;

constexpr std::uint32_t kLoopback = 0x7F000001;

/// Sends datagrams to a port of this host from 127.0.0.x.
class Sender {
 public:
  explicit Sender(int port, std::uint32_t source = kLoopback)
      : fd_(::socket(AF_INET, SOCK_DGRAM, 0)), to_(address(kLoopback, port)) {
    const sockaddr_in from = address(source, 0);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&from), sizeof from), 0);
  }
  ~Sender() { ::close(fd_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;
  void send(std::size_t bytes, std::uint8_t mark = 0) {
    std::vector<std::uint8_t> payload(bytes, mark);
    EXPECT_EQ(::sendto(fd_, payload.data(), bytes, 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_),
              static_cast<ssize_t>(bytes));
  }

 private:
  static sockaddr_in address(std::uint32_t ipv4, int port) {
    sockaddr_in result{};
    result.sin_family = AF_INET;
    result.sin_addr.s_addr = htonl(ipv4);
    result.sin_port = htons(static_cast<std::uint16_t>(port));
    return result;
  }
  int fd_;
  sockaddr_in to_;
};

struct Reception {
  explicit Reception(UdpReceiverOptions options = {}) {
    options.port = 0;
    auto opened = UdpReceiver::open(options, counters);
    EXPECT_TRUE(opened) << opened.error().message;
    receiver = std::move(*opened);
  }
  /// Reads until nothing has come for 20 ms.
  std::vector<RawPacket> read_all() {
    std::vector<RawPacket> packets;
    std::span<const RawPacket> batch;
    int quiet_count = 0;
    while (quiet_count < 2) {
      if (receiver->read(batch, 20ms) == ReadResult::packets) {
        packets.insert(packets.end(), batch.begin(), batch.end());
      } else {
        ++quiet_count;
      }
    }
    return packets;
  }
  [[nodiscard]] LidarCounts counts() const { return snapshot(counters); }

  LidarCounters counters;
  std::unique_ptr<UdpReceiver> receiver;
};

/// The first socket that asks for time stamps makes the kernel switch them on, which a busy kernel puts off: until then
/// a packet has the time at which it is read. Waits until that is over; the stamps stay on while `reception` lives.
void await_kernel_stamps(Reception& reception) {
  Sender sender(reception.receiver->port());
  for (int i = 0; i < 100; ++i) {
    sender.send(kPacketBytes);
    ::usleep(50'000);
    const std::int64_t read_ns = std::chrono::system_clock::now().time_since_epoch() / 1ns;
    const std::vector<RawPacket> packets = reception.read_all();
    if (packets.size() == 1 && packets[0].arrived.ns < read_ns - 25'000'000) return;
  }
  ADD_FAILURE() << "the kernel does not stamp packets";
}

TEST(UdpReceiver, takes_1206_bytes_and_no_other_length) {
  Reception reception;
  Sender sender(reception.receiver->port());
  const std::size_t lengths[] = {1205, 1206, 1207, 0, 1206, 2000, 512, 1214, 1206};
  std::uint8_t mark = 0;
  for (const std::size_t length : lengths) sender.send(length, ++mark);
  const std::vector<RawPacket> packets = reception.read_all();
  ASSERT_EQ(packets.size(), 3U);
  EXPECT_EQ(packets[0].bytes[0], 2);
  EXPECT_EQ(packets[1].bytes[1205], 5);
  EXPECT_EQ(packets[2].bytes[600], 9);
  EXPECT_EQ(reception.counts().received, 3U);
  EXPECT_EQ(reception.counts().wrong_length, 6U);
}

TEST(UdpReceiver, stamps_packets_with_the_kernels_receive_time) {
  Reception reception;
  await_kernel_stamps(reception);
  Sender sender(reception.receiver->port());
  const auto now_ns = [] {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
  };
  const std::int64_t before_ns = now_ns();
  sender.send(kPacketBytes);
  sender.send(kPacketBytes);
  const std::int64_t after_ns = now_ns();
  ::usleep(20'000);  // time that must not be in the stamps
  const std::vector<RawPacket> packets = reception.read_all();
  ASSERT_EQ(packets.size(), 2U);
  EXPECT_GE(packets[0].arrived.ns, before_ns - 1'000'000);
  EXPECT_LE(packets[1].arrived.ns, after_ns + 1'000'000);
  EXPECT_LE(packets[0].arrived, packets[1].arrived);
  EXPECT_EQ(packets[0].source_ipv4, kLoopback);
}

TEST(UdpReceiver, takes_only_its_own_sensor_when_told_which) {
  Reception reception({.source_ipv4 = kLoopback});
  Sender sensor(reception.receiver->port()), stranger(reception.receiver->port(), kLoopback + 1);
  sensor.send(kPacketBytes, 1);
  stranger.send(kPacketBytes, 2);
  stranger.send(100, 2);
  sensor.send(kPacketBytes, 3);
  const std::vector<RawPacket> packets = reception.read_all();
  ASSERT_EQ(packets.size(), 2U);
  EXPECT_EQ(packets[1].bytes[0], 3);
  EXPECT_EQ(reception.counts().foreign_source, 2U);
  EXPECT_EQ(reception.counts().wrong_length, 0U);
}

TEST(UdpReceiver, counts_what_the_kernel_dropped_from_a_full_buffer) {
  Reception reception({.receive_buffer_bytes = 20'000});
  Sender sender(reception.receiver->port());
  constexpr std::uint64_t kSent = 300;
  for (std::uint64_t i = 0; i < kSent; ++i) sender.send(kPacketBytes);
  const std::size_t first_count = reception.read_all().size();
  EXPECT_LT(first_count, kSent);
  sender.send(kPacketBytes);  // the kernel tells of drops with the first packet after them
  EXPECT_EQ(reception.read_all().size(), 1U);
  EXPECT_EQ(reception.counts().kernel_drops, kSent - first_count);
  EXPECT_EQ(reception.counts().received, first_count + 1);
}

TEST(UdpReceiver, takes_the_first_of_two_sensors_and_tells_of_both) {
  Reception reception;
  Sender first(reception.receiver->port()), second(reception.receiver->port(), kLoopback + 1);
  second.send(100);  // not a data packet: no sensor
  first.send(kPacketBytes, 1);
  second.send(kPacketBytes, 2);
  first.send(kPacketBytes, 3);
  EXPECT_EQ(reception.read_all().size(), 2U);
  EXPECT_EQ(reception.counts().foreign_source, 1U);
  EXPECT_EQ(reception.counts().wrong_length, 1U);
  EXPECT_TRUE(reception.receiver->senders()->ambiguous());
  EXPECT_EQ(reception.receiver->senders()->list(), "127.0.0.1, 127.0.0.2");
}

TEST(UdpReceiver, tells_who_sends_when_its_own_sensor_does_not) {
  Reception reception({.source_ipv4 = kLoopback});
  Sender stranger(reception.receiver->port(), kLoopback + 1);
  stranger.send(kPacketBytes);
  EXPECT_TRUE(reception.read_all().empty());
  EXPECT_FALSE(reception.receiver->senders()->ambiguous());
  EXPECT_EQ(reception.receiver->senders()->list(), "127.0.0.2");
}

/// A port that was free a moment ago.
int free_port() { return Reception().receiver->port(); }

TEST(UdpReceiver, takes_position_packets_from_their_own_port) {
  Reception reception({.position_port = free_port()});
  ASSERT_NE(reception.receiver->position_port(), 0) << reception.receiver->warning();
  Sender data(reception.receiver->port()), position(reception.receiver->position_port());
  for (const std::size_t length : {512U, 511U, 513U, 1206U, 0U}) position.send(length, 7);
  data.send(kPacketBytes, 1);
  data.send(kPositionPacketBytes, 1);  // on the data port it is one of a wrong length
  std::vector<RawPositionPacket> positions;
  std::size_t packet_count = 0;
  std::span<const RawPacket> batch;
  for (int quiet_count = 0; quiet_count < 2;) {
    if (reception.receiver->read(batch, 20ms) == ReadResult::quiet) ++quiet_count;
    packet_count += batch.size();
    positions.insert(positions.end(), reception.receiver->positions().begin(), reception.receiver->positions().end());
  }
  EXPECT_EQ(packet_count, 1U);
  ASSERT_EQ(positions.size(), 1U);
  EXPECT_EQ(positions[0].bytes[511], 7);
  EXPECT_GT(positions[0].arrived.ns, 0);
  EXPECT_EQ(reception.counts().position_packets, 1U);
  EXPECT_EQ(reception.counts().position_wrong_length, 4U);
  EXPECT_EQ(reception.counts().wrong_length, 1U);
}

TEST(UdpReceiver, goes_on_without_position_packets_when_their_port_is_taken) {
  Reception other;
  Reception reception({.position_port = other.receiver->port()});
  EXPECT_EQ(reception.receiver->position_port(), 0);
  EXPECT_THAT(std::string(reception.receiver->warning()),
              testing::AllOf(HasSubstr("no position packets"), HasSubstr("already in use")));
  Sender(reception.receiver->port()).send(kPacketBytes);
  EXPECT_EQ(reception.read_all().size(), 1U);
}

TEST(UdpReceiver, is_quiet_when_nothing_comes) {
  Reception reception;
  std::span<const RawPacket> batch;
  EXPECT_EQ(reception.receiver->read(batch, 1ms), ReadResult::quiet);
  EXPECT_TRUE(batch.empty());
}

TEST(UdpReceiver, reports_the_buffer_it_got) {
  Reception reception({.receive_buffer_bytes = 100'000});
  EXPECT_EQ(reception.receiver->receive_buffer_bytes(), 100'000);
}

TEST(UdpReceiver, says_so_when_the_port_is_taken) {
  Reception first;
  LidarCounters counters;
  const auto second = UdpReceiver::open({.port = first.receiver->port()}, counters);
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, testing::AllOf(HasSubstr(std::to_string(first.receiver->port())),
                                                     HasSubstr("already in use"), HasSubstr("ss -lunp")));
}

/// A socket as systemd would hand it over.
int bound_socket(int receive_buffer_bytes) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  EXPECT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes), 0);
  return fd;
}

int port_of(int fd) {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  EXPECT_EQ(::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length), 0);
  return ntohs(address.sin_port);
}

TEST(UdpReceiver, takes_over_a_socket_that_is_already_bound) {
  const int fd = bound_socket(100'000);
  LidarCounters counters;
  const auto receiver = UdpReceiver::open({.adopted_fd = fd}, counters);
  ASSERT_TRUE(receiver);
  EXPECT_EQ((*receiver)->fd(), fd);
  Sender sender((*receiver)->port());
  sender.send(kPacketBytes);
  std::span<const RawPacket> batch;
  EXPECT_EQ((*receiver)->read(batch, 100ms), ReadResult::packets);
}

TEST(UdpReceiver, leaves_the_larger_buffer_of_a_socket_it_takes_over_as_it_is) {
  LidarCounters counters;
  const auto receiver =
      UdpReceiver::open({.receive_buffer_bytes = 70'000, .adopted_fd = bound_socket(150'000)}, counters);
  ASSERT_TRUE(receiver);
  EXPECT_EQ((*receiver)->receive_buffer_bytes(), 150'000);
}

TEST(UdpReceiver, neither_takes_nor_counts_as_lost_what_came_before_it_took_over) {
  Reception stamping;
  await_kernel_stamps(stamping);
  const int fd = bound_socket(100'000);
  Sender sender(port_of(fd));
  for (int i = 0; i < 500; ++i) sender.send(kPacketBytes);  // more than the buffer holds
  LidarCounters counters;
  const auto receiver = UdpReceiver::open({.receive_buffer_bytes = 100'000, .adopted_fd = fd}, counters);
  ASSERT_TRUE(receiver);
  EXPECT_GT(counters.before_start.value(), 20U);
  EXPECT_LT(counters.before_start.value(), 500U);
  sender.send(kPacketBytes, 7);
  std::span<const RawPacket> batch;
  ASSERT_EQ((*receiver)->read(batch, 100ms), ReadResult::packets);
  ASSERT_EQ(batch.size(), 1U);
  EXPECT_EQ(batch[0].bytes[0], 7);
  EXPECT_EQ(counters.received.value(), 1U);
  EXPECT_EQ(counters.kernel_drops.value(), 0U);
}

TEST(UdpReceiver, takes_over_a_socket_for_position_packets) {
  const int fd = bound_socket(100'000);
  LidarCounters counters;
  const auto receiver =
      UdpReceiver::open({.port = 0, .position_port = port_of(fd), .adopted_position_fd = fd}, counters);
  ASSERT_TRUE(receiver);
  EXPECT_EQ((*receiver)->warning(), "");
  Sender(port_of(fd)).send(kPositionPacketBytes);
  std::span<const RawPacket> batch;
  EXPECT_EQ((*receiver)->read(batch, 100ms), ReadResult::packets);
  EXPECT_EQ(counters.position_packets.value(), 1U);
}

TEST(UdpReceiver, refuses_a_socket_that_is_not_udp) {
  LidarCounters counters;
  const auto receiver = UdpReceiver::open({.adopted_fd = ::socket(AF_INET, SOCK_STREAM, 0)}, counters);
  ASSERT_FALSE(receiver);
  EXPECT_THAT(receiver.error().message, HasSubstr("ListenDatagram="));
}

TEST(UdpReceiver, fails_with_a_reason_when_its_socket_breaks) {
  Reception reception;
  const int other = ::open("/dev/null", 0);
  ::dup2(other, reception.receiver->fd());
  ::close(other);
  std::span<const RawPacket> batch;
  EXPECT_EQ(reception.receiver->read(batch, 1ms), ReadResult::failed);
  EXPECT_THAT(std::string(reception.receiver->error()), HasSubstr("recvmmsg failed"));
}

}  // namespace
}  // namespace roadvec
