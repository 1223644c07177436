#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>
#include <vector>

#include "drivers/can/socketcan_reader.h"

namespace roadvec {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// What CanSystem's functions do in a test; they are plain functions, so this is where they look.
std::vector<int> fds_to_open;
std::vector<int> errors_to_receive;
int open_calls = 0;

Expected<int> open_adopted(const std::string&, std::span<const CanId>) {
  ++open_calls;
  if (fds_to_open.empty()) return fail("no such interface");
  const int fd = fds_to_open.front();
  fds_to_open.erase(fds_to_open.begin());
  return fd;
}

ssize_t receive_or_fail(int fd, msghdr* message, int flags) {
  if (errors_to_receive.empty()) return ::recvmsg(fd, message, flags);
  errno = errors_to_receive.front();
  errors_to_receive.erase(errors_to_receive.begin());
  return -1;
}

/// A datagram pair in place of a bus: this kernel may have no CAN, and no test may need one.
class SocketCanTest : public testing::Test {
 protected:
  void SetUp() override {
    fds_to_open.clear();
    errors_to_receive.clear();
    open_calls = 0;
    connect();
    reader_ = *SocketCanReader::open("can7", {}, {.receive = receive_or_fail, .open = open_adopted});
  }
  void TearDown() override {
    for (const int fd : buses_) ::close(fd);
  }
  void connect() {
    std::array<int, 2> pair{};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM, 0, pair.data()), 0);
    const int on = 1;
    ::setsockopt(pair[0], SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    fds_to_open.push_back(pair[0]);
    buses_.push_back(pair[1]);
  }
  template <class Raw>
  void send(const Raw& raw) {
    ASSERT_EQ(::send(buses_.back(), &raw, sizeof raw, 0), static_cast<ssize_t>(sizeof raw));
  }
  void send_classic(canid_t id, std::initializer_list<std::uint8_t> bytes) {
    can_frame raw{};
    raw.can_id = id;
    raw.can_dlc = static_cast<std::uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), raw.data);
    send(raw);
  }
  CanReadResult read() { return reader_->read(frame_, 1ms); }

  std::vector<int> buses_;
  std::unique_ptr<SocketCanReader> reader_;
  CanFrame frame_;
};

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

TEST_F(SocketCanTest, classic_extended_remote_and_fd_frames_come_as_they_were_sent) {
  const std::int64_t before_ns = now_ns();
  send_classic(0x123, {1, 2, 3});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(frame_.id, 0x123U);
  EXPECT_EQ(frame_.length, 3);
  EXPECT_EQ(frame_.data[2], 3);
  EXPECT_FALSE(frame_.extended || frame_.fd || frame_.remote || frame_.error);
  EXPECT_GE(frame_.time.ns, before_ns);
  EXPECT_LE(frame_.time.ns, now_ns());

  send_classic(0x18FEF1FE | CAN_EFF_FLAG, {9});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_TRUE(frame_.extended);
  EXPECT_EQ(frame_.id, 0x18FEF1FEU);
  EXPECT_EQ(frame_.data[2], 0) << "left from the frame before";

  send_classic(0x123 | CAN_RTR_FLAG, {0, 0});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_TRUE(frame_.remote);

  canfd_frame fd{};
  fd.can_id = 0x7FF;
  fd.len = 64;
  fd.data[63] = 77;
  send(fd);
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_TRUE(frame_.fd);
  EXPECT_EQ(frame_.length, 64);
  EXPECT_EQ(frame_.data[63], 77);
  EXPECT_EQ(reader_->counters().frame_count, 4U);
  EXPECT_EQ(read(), CanReadResult::quiet);
}

TEST_F(SocketCanTest, the_time_is_the_kernels_at_reception_not_that_of_reading) {
  send_classic(1, {});
  const std::int64_t sent_ns = now_ns();
  ::usleep(20000);
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_LE(frame_.time.ns, sent_ns);
}

TEST_F(SocketCanTest, error_frames_are_counted_by_class) {
  send_classic(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_RX_OVERFLOW, 0, 0, 0, 0, 0, 0});
  send_classic(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  send_classic(CAN_ERR_FLAG | CAN_ERR_RESTARTED, {0, 0, 0, 0, 0, 0, 0, 0});
  send_classic(CAN_ERR_FLAG | CAN_ERR_PROT | CAN_ERR_BUSERROR, {0, 0, 0, 0, 0, 0, 0, 0});
  send_classic(CAN_ERR_FLAG | CAN_ERR_TX_TIMEOUT, {0, 0, 0, 0, 0, 0, 0, 0});
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(read(), CanReadResult::frame);
    EXPECT_TRUE(frame_.error);
  }
  const CanCounters& counters = reader_->counters();
  EXPECT_EQ(counters.error_frame_count, 5U);
  EXPECT_EQ(counters.controller_problem_count, 1U);
  EXPECT_EQ(counters.controller_overflow_count, 1U);
  EXPECT_EQ(counters.bus_off_count, 1U);
  EXPECT_EQ(counters.restarted_count, 1U);
  EXPECT_EQ(counters.bus_error_count, 1U);
  EXPECT_EQ(counters.other_error_count, 1U);
  EXPECT_EQ(counters.passive_count, 0U);
}

TEST_F(SocketCanTest, bus_off_lasts_until_the_controller_is_restarted_or_a_frame_comes) {
  const auto state = [this] { return reader_->counters().state; };
  EXPECT_EQ(state(), CanState::working);
  send_classic(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_TX_PASSIVE, 0, 0, 0, 0, 0, 0});
  send_classic(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(reader_->counters().passive_count, 1U);
  EXPECT_EQ(state(), CanState::working);
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(state(), CanState::bus_off);
  send_classic(CAN_ERR_FLAG | CAN_ERR_RESTARTED, {0, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(state(), CanState::working);
  send_classic(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(state(), CanState::bus_off);
  send_classic(5, {});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(state(), CanState::working);
}

TEST_F(SocketCanTest, datagrams_that_are_no_frame_are_counted) {
  send(std::array<char, 15>{});
  send(std::array<char, 2000>{});
  can_frame nine_bytes{};
  nine_bytes.can_dlc = 9;
  send(nine_bytes);
  canfd_frame too_long{};
  too_long.len = 65;
  send(too_long);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(read(), CanReadResult::quiet);
  EXPECT_EQ(reader_->counters().wrong_size_count, 4U);
  EXPECT_EQ(reader_->counters().frame_count, 0U);
}

TEST_F(SocketCanTest, an_interface_that_goes_down_is_waited_for) {
  errors_to_receive = {ENETDOWN};
  send_classic(5, {});
  EXPECT_EQ(read(), CanReadResult::quiet);
  EXPECT_EQ(reader_->counters().interface_down_count, 1U);
  EXPECT_EQ(reader_->counters().state, CanState::down);
  EXPECT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(reader_->counters().state, CanState::working);
  EXPECT_EQ(open_calls, 1);
}

TEST_F(SocketCanTest, a_removed_interface_is_looked_for_ever_less_often_until_it_is_back) {
  errors_to_receive = {ENODEV};
  send_classic(5, {});
  EXPECT_EQ(read(), CanReadResult::quiet);
  EXPECT_EQ(reader_->counters().interface_lost_count, 1U);
  EXPECT_EQ(reader_->counters().state, CanState::lost);
  for (int i = 0; i < 14; ++i) EXPECT_EQ(reader_->read(frame_, 20ms), CanReadResult::quiet);
  EXPECT_EQ(open_calls, 1 + 1) << "tried after 100 ms, and not again before 300 ms";
  connect();
  EXPECT_EQ(reader_->read(frame_, 20ms), CanReadResult::quiet);
  EXPECT_EQ(open_calls, 1 + 2);
  EXPECT_EQ(reader_->counters().reopened_count, 1U);
  EXPECT_EQ(reader_->counters().state, CanState::working);
  EXPECT_GT(reader_->counters().receive_buffer_bytes, 0U);
  send_classic(6, {});
  ASSERT_EQ(read(), CanReadResult::frame);
  EXPECT_EQ(frame_.id, 6U);
}

TEST_F(SocketCanTest, an_interrupted_call_is_quiet_and_an_unknown_failure_fails) {
  send_classic(5, {});
  errors_to_receive = {EINTR, EAGAIN, EIO};
  EXPECT_EQ(read(), CanReadResult::quiet);
  EXPECT_EQ(read(), CanReadResult::quiet);
  EXPECT_EQ(read(), CanReadResult::failed);
}

TEST_F(SocketCanTest, the_interface_has_its_name) {
  EXPECT_EQ(reader_->interface_name(0), "can7");
  EXPECT_EQ(reader_->interface_name(1), "");
}

// The kernel tells a socket of its drops with the next datagram; UDP does so as CAN does, and every kernel has it.
TEST(SocketCanDrops, frames_the_kernel_dropped_are_counted) {
  const int receiver = ::socket(AF_INET, SOCK_DGRAM, 0);
  const int sender = ::socket(AF_INET, SOCK_DGRAM, 0);
  const int on = 1;
  const int small = 4096;
  ::setsockopt(receiver, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  ::setsockopt(receiver, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(receiver, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::getsockname(receiver, reinterpret_cast<sockaddr*>(&address), &size), 0);
  ASSERT_EQ(::connect(sender, reinterpret_cast<sockaddr*>(&address), size), 0);
  fds_to_open = {receiver};
  auto reader = SocketCanReader::open("can7", {}, {.open = open_adopted});
  ASSERT_TRUE(reader);
  const can_frame raw{};
  constexpr std::uint64_t kSent = 500;
  for (std::uint64_t i = 0; i < kSent; ++i) ASSERT_EQ(::send(sender, &raw, sizeof raw, 0), 16);
  CanFrame frame;
  while ((*reader)->read(frame, 1ms) == CanReadResult::frame) {
  }
  ASSERT_EQ(::send(sender, &raw, sizeof raw, 0), 16);
  ASSERT_EQ((*reader)->read(frame, 10ms), CanReadResult::frame);
  const CanCounters& counters = (*reader)->counters();
  EXPECT_GT(counters.kernel_drop_count, 0U);
  EXPECT_EQ(counters.frame_count + counters.kernel_drop_count, kSent + 1);
  ::close(sender);
}

TEST(SocketCanOpen, an_interface_that_cannot_be_read_is_an_error_with_its_name_and_a_remedy) {
  const std::array<CanId, 2> ids = {CanId{0x25, false}, CanId{0x18FEF1FE, true}};
  const auto reader = SocketCanReader::open("no_such_can", ids);
  ASSERT_FALSE(reader);
  EXPECT_THAT(reader.error().message, HasSubstr("no_such_can"));
  // Which of the two it is depends on the kernel that runs the test.
  EXPECT_THAT(reader.error().message,
              testing::AnyOf(HasSubstr("modprobe can_raw"), HasSubstr("ip link set no_such_can up")));
}

}  // namespace
}  // namespace roadvec
