#include "drivers/imu/xsens_setup.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "drivers/imu/mtdata2.h"

namespace roadvec {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

Bytes message(std::uint8_t kind, const Bytes& content = {}) {
  Bytes bytes{0xFA, 0xFF, kind, static_cast<std::uint8_t>(content.size())};
  bytes.insert(bytes.end(), content.begin(), content.end());
  unsigned sum = 0;
  for (std::size_t i = 1; i < bytes.size(); ++i) sum += bytes[i];
  bytes.push_back(static_cast<std::uint8_t>(0x100 - (sum & 0xFF)));
  return bytes;
}

/// An MTi at the other end of a pseudo terminal: it measures until it is told to listen, and keeps its outputs.
class FakeDevice {
 public:
  struct Manners {
    bool silent = false;                  ///< never answers
    std::uint8_t refuses = 0xFF;          ///< answers this request with an error
    int deaf_count = 0;                   ///< requests that it does not hear at first
    std::uint16_t most_rate_hz = 0xFFFF;  ///< of what it offers
  };
  explicit FakeDevice(const Manners& manners) : manners_(manners), fd_(::posix_openpt(O_RDWR | O_NOCTTY)) {
    EXPECT_EQ(::grantpt(fd_), 0);
    EXPECT_EQ(::unlockpt(fd_), 0);
    path_ = ::ptsname(fd_);
    keep_open_ = ::open(path_.c_str(), O_RDWR | O_NOCTTY);
    termios mode{};  // a serial line echoes nothing; a terminal does until somebody says otherwise
    EXPECT_EQ(::tcgetattr(keep_open_, &mode), 0);
    ::cfmakeraw(&mode);
    EXPECT_EQ(::tcsetattr(keep_open_, TCSANOW, &mode), 0);
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  ~FakeDevice() {
    thread_.request_stop();
    thread_.join();
    ::close(fd_);
    ::close(keep_open_);
  }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] bool measuring() const { return measuring_; }

 private:
  void run(const std::stop_token& stop) {
    Bytes received;
    while (!stop.stop_requested()) {
      if (measuring_) send(message(0x36, {0x10, 0x20, 2, 0, 1}));
      pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
      if (::poll(&waiting, 1, 5) <= 0) continue;
      std::array<std::uint8_t, 256> bytes{};
      const ssize_t count = ::read(fd_, bytes.data(), bytes.size());
      if (count > 0) received.insert(received.end(), bytes.begin(), bytes.begin() + count);
      XbusMessage request;
      while (read_xbus(received, request) == XbusFront::message) {
        answer(request.kind, Bytes(request.content.begin(), request.content.end()));
        received.erase(received.begin(), received.begin() + static_cast<long>(request.byte_count));
      }
    }
  }
  void answer(std::uint8_t kind, const Bytes& content) {
    if (manners_.silent || manners_.deaf_count-- > 0) return;
    if (kind == manners_.refuses) return send(message(0x42, {4}));
    Bytes reply;
    if (kind == 0x30) measuring_ = false;
    if (kind == 0x10) measuring_ = true;
    if (kind == 0x00) reply = {0x03, 0x80, 0x12, 0x34};
    if (kind == 0x1C) reply = {'M', 'T', 'i', '-', '6', '3', '0', ' ', ' '};
    if (kind == 0x12) reply = {1, 10, 2, 0, 0, 0, 1};
    if (kind == 0xC0 && !content.empty()) set_outputs(content);
    if (kind == 0xC0) reply = outputs_;
    send(message(static_cast<std::uint8_t>(kind + 1), reply));
  }
  void set_outputs(const Bytes& content) {
    outputs_ = content;
    for (std::size_t i = 2; i + 1 < outputs_.size(); i += 4) {
      const int rate_hz = outputs_[i] << 8 | outputs_[i + 1];
      if (rate_hz == 0xFFFF || rate_hz <= manners_.most_rate_hz) continue;
      outputs_[i] = static_cast<std::uint8_t>(manners_.most_rate_hz >> 8);
      outputs_[i + 1] = static_cast<std::uint8_t>(manners_.most_rate_hz);
    }
  }
  void send(const Bytes& bytes) const { EXPECT_GT(::write(fd_, bytes.data(), bytes.size()), 0); }

  Manners manners_;
  int fd_, keep_open_ = -1;
  std::string path_;
  std::atomic<bool> measuring_{true};
  Bytes outputs_{0x80, 0x20, 0, 50};
  std::jthread thread_;
};

TEST(XsensSetup, a_measuring_device_is_stopped_asked_told_and_started_again) {
  FakeDevice device({});
  const auto set = set_up_xsens(device.path(), 115200, default_xsens_outputs());
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(set->product, "MTi-630");
  EXPECT_EQ(set->device_id, 0x03801234U);
  EXPECT_EQ(set->firmware, "1.10.2");
  EXPECT_TRUE(std::equal(set->outputs.begin(), set->outputs.end(), default_xsens_outputs().begin(),
                         default_xsens_outputs().end()));
  EXPECT_EQ(set->text(), "MTi-630, firmware 1.10.2, sends 1020 1060 2010@100 4020@100 8020@100 E020");
  EXPECT_TRUE(device.measuring());
}

TEST(XsensSetup, a_request_that_is_not_heard_is_repeated) {
  FakeDevice device({.deaf_count = 2});
  EXPECT_TRUE(set_up_xsens(device.path(), 115200, default_xsens_outputs(), 100ms));
}

TEST(XsensSetup, what_the_device_refuses_or_does_not_offer_is_named) {
  FakeDevice refusing({.refuses = 0xC0});
  EXPECT_THAT(set_up_xsens(refusing.path(), 115200, default_xsens_outputs()).error().message,
              AllOf(HasSubstr(refusing.path()), HasSubstr("set the outputs"), HasSubstr("error code 4")));
  FakeDevice slow({.most_rate_hz = 50});
  EXPECT_THAT(set_up_xsens(slow.path(), 115200, default_xsens_outputs()).error().message,
              AllOf(HasSubstr("does not send 2010@100"), HasSubstr("2010@50")));
}

TEST(XsensSetup, a_device_that_does_not_answer_and_one_that_is_not_there_are_told_apart) {
  FakeDevice silent({.silent = true});
  EXPECT_THAT(set_up_xsens(silent.path(), 115200, default_xsens_outputs(), 20ms).error().message,
              AllOf(HasSubstr("stop measuring"), HasSubstr("no answer"), HasSubstr("imu.baud")));
  EXPECT_THAT(set_up_xsens("/dev/no-imu", 115200, default_xsens_outputs()).error().message,
              HasSubstr("no such device"));
}

}  // namespace
}  // namespace roadvec
