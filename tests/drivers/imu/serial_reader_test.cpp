#include "drivers/imu/serial_reader.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace roadvec {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// The device's end of a pseudo terminal; the other end has a name as a serial device has.
class Device {
 public:
  Device() : fd_(::posix_openpt(O_RDWR | O_NOCTTY)) {
    EXPECT_EQ(::grantpt(fd_), 0);
    EXPECT_EQ(::unlockpt(fd_), 0);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device() { ::close(fd_); }
  std::string path() const { return ::ptsname(fd_); }
  void send(const std::vector<std::uint8_t>& bytes) const {
    ASSERT_EQ(::write(fd_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  int fd() const { return fd_; }

 private:
  int fd_;
};

std::vector<std::uint8_t> every_byte() {
  std::vector<std::uint8_t> bytes(256);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i);
  return bytes;
}

std::vector<std::uint8_t> read_all(SerialReader& reader) {
  std::vector<std::uint8_t> all;
  ImuBytes bytes;
  while (reader.read(bytes, 20ms) == ImuReadResult::bytes)
    all.insert(all.end(), bytes.bytes.begin(), bytes.bytes.end());
  return all;
}

TEST(SerialReader, every_byte_value_comes_through_unchanged_and_nothing_is_echoed_or_sent) {
  Device device;
  auto reader = SerialReader::open(device.path(), 115200);
  ASSERT_TRUE(reader) << reader.error().message;
  device.send(every_byte());
  EXPECT_EQ(read_all(**reader), every_byte());
  EXPECT_EQ((*reader)->counters().byte_count, 256U);
  ASSERT_EQ(::fcntl(device.fd(), F_SETFL, O_NONBLOCK), 0);
  char sent = 0;
  EXPECT_EQ(::read(device.fd(), &sent, 1), -1);
}

TEST(SerialReader, the_line_is_raw_at_the_speed_asked_for) {
  Device device;
  auto reader = SerialReader::open(device.path(), 921600);
  ASSERT_TRUE(reader);
  const int fd = ::open(device.path().c_str(), O_RDWR | O_NOCTTY);
  termios line{};
  ASSERT_EQ(::tcgetattr(fd, &line), 0);
  ::close(fd);
  EXPECT_EQ(::cfgetispeed(&line), static_cast<speed_t>(B921600));
  EXPECT_EQ(line.c_lflag & (ICANON | ECHO | ISIG), 0U);
  EXPECT_EQ(line.c_iflag & (IXON | ICRNL | ISTRIP), 0U);
  EXPECT_EQ(line.c_cflag & CSIZE, static_cast<tcflag_t>(CS8));
}

TEST(SerialReader, bytes_are_stamped_when_they_are_fetched_and_silence_is_quiet) {
  Device device;
  auto reader = SerialReader::open(device.path(), 115200);
  ASSERT_TRUE(reader);
  ImuBytes bytes;
  EXPECT_EQ((*reader)->read(bytes, 1ms), ImuReadResult::quiet);
  const auto now_ns = [] {
    return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  };
  const std::int64_t before_ns = now_ns();
  device.send({1, 2, 3});
  ASSERT_EQ((*reader)->read(bytes, 100ms), ImuReadResult::bytes);
  EXPECT_TRUE(bytes.has_time);
  EXPECT_GE(bytes.time.ns, before_ns);
  EXPECT_LE(bytes.time.ns, now_ns());
}

TEST(SerialReader, a_device_that_vanishes_is_counted_and_found_again_under_its_path) {
  const std::string path = testing::TempDir() + "roadvec_serial_by_id";
  std::filesystem::remove(path);
  auto device = std::make_unique<Device>();
  std::filesystem::create_symlink(device->path(), path);
  auto reader = SerialReader::open(path, 115200);
  ASSERT_TRUE(reader);
  device.reset();
  std::filesystem::remove(path);
  ImuBytes bytes;
  EXPECT_EQ((*reader)->read(bytes, 50ms), ImuReadResult::quiet);
  EXPECT_EQ((*reader)->counters().device_lost_count, 1U);
  for (int i = 0; i < 3; ++i) EXPECT_EQ((*reader)->read(bytes, 40ms), ImuReadResult::quiet);
  EXPECT_EQ((*reader)->counters().reopened_count, 0U);

  device = std::make_unique<Device>();
  std::filesystem::create_symlink(device->path(), path);
  for (int i = 0; i < 20 && (*reader)->counters().reopened_count == 0; ++i) {
    EXPECT_EQ((*reader)->read(bytes, 40ms), ImuReadResult::quiet);
  }
  EXPECT_EQ((*reader)->counters().reopened_count, 1U);
  device->send({7});
  ASSERT_EQ((*reader)->read(bytes, 100ms), ImuReadResult::bytes);
  EXPECT_THAT(bytes.bytes, testing::ElementsAre(7));
  EXPECT_EQ((*reader)->counters().device_lost_count, 1U);
  std::filesystem::remove(path);
}

TEST(SerialReader, what_cannot_be_opened_is_an_error_with_its_path_and_a_remedy) {
  EXPECT_THAT(SerialReader::open("/dev/no_such_imu", 115200).error().message,
              testing::AllOf(HasSubstr("/dev/no_such_imu"), HasSubstr("/dev/serial/by-id")));
  EXPECT_THAT(SerialReader::open("/dev/null", 115200).error().message, HasSubstr("not a serial line"));
  EXPECT_THAT(SerialReader::open("/dev/null", 1234).error().message, HasSubstr("115200"));
}

}  // namespace
}  // namespace roadvec
