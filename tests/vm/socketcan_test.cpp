// The reader on a real bus: vcan and can-utils. run.sh gives both; this program is not run without it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "drivers/can/can_log_reader.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/can/socketcan_reader.h"

namespace roadvec {
namespace {

using namespace std::chrono_literals;

constexpr const char* kErrorData = "0000000000000000";

void shell(const std::string& command) { ASSERT_EQ(std::system(command.c_str()), 0) << command; }

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

class VcanTest : public testing::Test {
 protected:
  void SetUp() override { add_interface(); }
  void TearDown() override {
    reader_.reset();
    static_cast<void>(std::system("ip link del vcan0 2>/dev/null"));
  }
  static void add_interface() { shell("ip link add vcan0 mtu 72 type vcan && ip link set vcan0 up"); }
  void open(std::vector<CanId> ids = {}) {
    auto reader = SocketCanReader::open("vcan0", ids);
    ASSERT_TRUE(reader) << reader.error().message;
    reader_ = std::move(*reader);
  }
  static void send(const std::string& frame) { shell("cansend vcan0 " + frame); }

  /// Every frame until the bus has been quiet for a while.
  std::vector<CanFrame> frames() {
    std::vector<CanFrame> all;
    CanFrame frame;
    for (int quiet = 0; quiet < 3;) {
      const CanReadResult result = reader_->read(frame, 50ms);
      if (result == CanReadResult::frame) all.push_back(frame);
      if (result == CanReadResult::failed) {
        ADD_FAILURE() << "the reader has failed";
        break;
      }
      quiet = result == CanReadResult::quiet ? quiet + 1 : 0;
    }
    return all;
  }
  /// Reads on until `happened`, for ten seconds at most: the guest's clock is not to be trusted with less.
  bool read_until(const std::function<bool()>& happened) {
    CanFrame frame;
    for (int i = 0; i < 200 && !happened(); ++i) static_cast<void>(reader_->read(frame, 50ms));
    return happened();
  }

  std::unique_ptr<SocketCanReader> reader_;
};

TEST_F(VcanTest, standard_extended_remote_fd_and_error_frames_come_as_they_were_sent) {
  open();
  send("123#0102030405060708");
  send("18FEF1FE#09");
  send("7FF#R4");
  send("456##311223344556677889900AABB");
  send(std::string("20000040#") + kErrorData);
  const std::vector<CanFrame> all = frames();
  ASSERT_EQ(all.size(), 5U);
  EXPECT_EQ(all[0].id, 0x123U);
  EXPECT_EQ(all[0].length, 8);
  EXPECT_EQ(all[0].data[7], 8);
  EXPECT_FALSE(all[0].extended || all[0].remote || all[0].fd || all[0].error);
  EXPECT_TRUE(all[1].extended);
  EXPECT_EQ(all[1].id, 0x18FEF1FEU);
  EXPECT_TRUE(all[2].remote);
  EXPECT_EQ(all[2].length, 4);
  EXPECT_TRUE(all[3].fd);
  EXPECT_EQ(all[3].length, 12);
  EXPECT_EQ(all[3].data[11], 0xBB);
  EXPECT_TRUE(all[4].error);
  EXPECT_EQ(reader_->counters().bus_off_count, 1U);
  EXPECT_EQ(reader_->counters().frame_count, 5U);
}

TEST_F(VcanTest, stamps_are_the_kernels_at_reception_however_late_the_frame_is_read) {
  open();
  const std::int64_t before_ns = now_ns();
  send("123#01");
  const std::int64_t after_ns = now_ns();
  std::this_thread::sleep_for(300ms);
  const std::vector<CanFrame> all = frames();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_GE(all[0].time.ns, before_ns);
  EXPECT_LE(all[0].time.ns, after_ns);
}

TEST_F(VcanTest, the_kernel_lets_the_wanted_ids_through_and_errors_of_the_bus) {
  open({{0x25, false}, {0x18FEF1FE, true}});
  for (const char* frame :
       {"025#01", "026#02", "00000025#03", "18FEF1FE#04", "18FEF1FF#05", "025#R", "025##011", "7FF#06"}) {
    send(frame);
  }
  send(std::string("20000100#") + kErrorData);
  const std::vector<CanFrame> all = frames();
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ(all[0].data[0], 1);
  EXPECT_EQ(all[1].data[0], 4);
  EXPECT_TRUE(all[2].fd);
  EXPECT_TRUE(all[3].error);
  EXPECT_EQ(reader_->counters().restarted_count, 1U);
}

TEST_F(VcanTest, a_bus_that_goes_down_and_up_again_goes_on) {
  open();
  shell("ip link set vcan0 down");
  EXPECT_TRUE(read_until([this] { return reader_->counters().interface_down_count == 1; }));
  EXPECT_TRUE(frames().empty());
  shell("ip link set vcan0 up");
  send("123#07");
  ASSERT_EQ(frames().size(), 1U);
  EXPECT_EQ(reader_->counters().interface_down_count, 1U);
  EXPECT_EQ(reader_->counters().interface_lost_count, 0U);
}

TEST_F(VcanTest, a_bus_that_is_down_at_the_start_is_waited_for) {
  shell("ip link set vcan0 down");
  open();
  EXPECT_TRUE(frames().empty());
  shell("ip link set vcan0 up");
  send("123#08");
  EXPECT_EQ(frames().size(), 1U);
}

TEST_F(VcanTest, an_interface_that_is_removed_and_comes_back_is_opened_again_by_its_name_with_its_filter) {
  open({{0x123, false}});
  shell("ip link del vcan0");
  EXPECT_TRUE(read_until([this] { return reader_->counters().interface_lost_count == 1; }));
  EXPECT_TRUE(frames().empty());
  shell("ip link add vcan9 type vcan");  // takes the next number, so that only the name can find it
  add_interface();
  EXPECT_TRUE(read_until([this] { return reader_->counters().reopened_count == 1; }));
  send("124#00");
  send("123#09");
  const std::vector<CanFrame> all = frames();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].data[0], 9);
  shell("ip link del vcan9");
}

/// More than any buffer holds, sent from this very process and before anything is read.
TEST_F(VcanTest, frames_that_the_full_buffer_refused_are_counted_to_the_last) {
  open();
  constexpr std::uint64_t kSent = 20000;
  const int bus = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex("vcan0"));
  ASSERT_EQ(::bind(bus, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  can_frame raw{};
  raw.can_id = 0x321;
  for (std::uint64_t i = 0; i < kSent; ++i) {
    while (::write(bus, &raw, sizeof raw) < 0 && errno == ENOBUFS) std::this_thread::sleep_for(1ms);
  }
  ::close(bus);
  std::uint64_t read_count = frames().size();
  EXPECT_LT(read_count, kSent);
  send("123#01");  // the kernel tells of its drops with the next frame that it queues
  read_count += frames().size();
  EXPECT_EQ(read_count + reader_->counters().kernel_drop_count, kSent + 1);
}

std::string text_of(const MotionSample& sample) {
  if (const auto* angle = std::get_if<SteeringAngle>(&sample.value)) return std::to_string(angle->wheel_rad);
  const auto& speed = std::get<WheelSpeed>(sample.value);
  return std::to_string(speed.front_left_mps) + " " + std::to_string(speed.front_right_mps) + " " +
         std::to_string(speed.rear_left_mps) + " " + std::to_string(speed.rear_right_mps);
}

std::vector<std::string> samples_of(const std::vector<CanFrame>& all, MotionDecoder decoder) {
  std::vector<std::string> samples;
  for (const CanFrame& frame : all) {
    for (const MotionSample& sample : decoder.decode(frame)) samples.push_back(text_of(sample));
  }
  return samples;
}

TEST_F(VcanTest, a_drive_played_by_canplayer_gives_the_samples_that_its_log_gives) {
  const std::string drive = std::getenv("ROADVEC_TEST_DRIVE");
  const auto dbc = load_dbc(drive + "/vehicle.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  VehicleSignals signals;
  signals.steering.sum = {"SteeringSensor.SteeringWheelAngle"};
  for (const char* wheel : {"FL", "FR", "RL", "RR"}) {
    signals.wheel_speeds.emplace_back().sum = {std::string("WheelSpeeds.WheelSpeed") + wheel};
  }
  const auto decoder = MotionDecoder::create(*dbc, signals);
  ASSERT_TRUE(decoder) << decoder.error().message;

  auto log = CanLogReader::open(drive + "/can.log");
  ASSERT_TRUE(log) << log.error().message;
  std::vector<CanFrame> recorded;
  CanFrame frame;
  while ((*log)->read(frame, 0ms) == CanReadResult::frame) recorded.push_back(frame);

  open({decoder->ids().begin(), decoder->ids().end()});
  std::jthread player([&drive] { shell("canplayer -I " + drive + "/can.log vcan0=can0"); });
  ASSERT_TRUE(read_until([this] { return reader_->counters().frame_count == 1; }));
  std::vector<CanFrame> played = frames();
  const std::vector<std::string> expected = samples_of(recorded, *decoder);
  std::vector<std::string> first = samples_of({recorded.front()}, *decoder);  // the frame that read_until took
  const std::vector<std::string> rest = samples_of(played, *decoder);
  first.insert(first.end(), rest.begin(), rest.end());
  EXPECT_GT(expected.size(), 100U);
  EXPECT_EQ(first, expected);
  EXPECT_EQ(reader_->counters().kernel_drop_count, 0U);
}

}  // namespace
}  // namespace roadvec
