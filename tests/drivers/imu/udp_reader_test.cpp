#include "drivers/imu/udp_reader.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <vector>

namespace roadvec {
namespace {

using namespace std::chrono_literals;

void send_to(int port, const std::vector<std::uint8_t>& bytes) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  EXPECT_EQ(::sendto(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to),
            static_cast<ssize_t>(bytes.size()));
  ::close(fd);
}

TEST(ImuUdpReader, each_datagram_is_one_piece_with_its_stamp) {
  auto reader = ImuUdpReader::open(0);
  ASSERT_TRUE(reader) << reader.error().message;
  ImuBytes bytes;
  EXPECT_EQ((*reader)->read(bytes, 1ms), ImuReadResult::quiet);
  send_to((*reader)->port(), {1, 2, 3});
  send_to((*reader)->port(), {4});
  ASSERT_EQ((*reader)->read(bytes, 1s), ImuReadResult::bytes);
  EXPECT_THAT(bytes.bytes, testing::ElementsAre(1, 2, 3));
  EXPECT_TRUE(bytes.has_time);
  const SensorTime first = bytes.time;
  EXPECT_GT(first.ns, 0);
  ASSERT_EQ((*reader)->read(bytes, 1s), ImuReadResult::bytes);
  EXPECT_THAT(bytes.bytes, testing::ElementsAre(4));
  EXPECT_GE(bytes.time, first);
  EXPECT_EQ((*reader)->read(bytes, 1ms), ImuReadResult::quiet);
  EXPECT_EQ((*reader)->counters().byte_count, 4U);
}

TEST(ImuUdpReader, says_so_when_the_port_is_taken) {
  auto first = ImuUdpReader::open(0);
  ASSERT_TRUE(first);
  const auto second = ImuUdpReader::open((*first)->port());
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, testing::AllOf(testing::HasSubstr("IMU"), testing::HasSubstr("already in use")));
}

}  // namespace
}  // namespace roadvec
