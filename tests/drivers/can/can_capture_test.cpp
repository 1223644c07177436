#include "drivers/can/can_capture_reader.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

namespace roadvec {
namespace {

using testing::HasSubstr;

constexpr int kSocketCan = 227, kEthernet = 1;
constexpr std::uint32_t kExtended = 0x80000000, kRemote = 0x40000000, kError = 0x20000000;

void put_u32(std::string& text, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) text += static_cast<char>(value >> 8 * i & 0xFF);
}

class CanCapture : public testing::Test {
 protected:
  CanCapture() {
    put_u32(text_, 0xA1B23C4D);  // nanoseconds
    put_u32(text_, 2 | 4 << 16);
    for (const std::uint32_t word : {0U, 0U, 262144U}) put_u32(text_, word);
    link_at_ = text_.size();
    put_u32(text_, kSocketCan);
  }
  ~CanCapture() override { std::filesystem::remove(path_); }

  void record(std::uint32_t seconds, std::uint32_t nanoseconds, const std::string& bytes) {
    put_u32(text_, seconds);
    put_u32(text_, nanoseconds);
    put_u32(text_, static_cast<std::uint32_t>(bytes.size()));
    put_u32(text_, static_cast<std::uint32_t>(bytes.size()));
    text_ += bytes;
  }
  static std::string can(std::uint32_t id, const std::string& data, std::uint8_t fd_flags = 0) {
    std::string bytes;
    for (int i = 3; i >= 0; --i) bytes += static_cast<char>(id >> 8 * i & 0xFF);
    bytes += static_cast<char>(data.size());
    bytes += static_cast<char>(fd_flags);
    return bytes + std::string(2, '\0') + data;
  }
  Expected<std::unique_ptr<CanReader>> open(std::int64_t offset_ns = 0) {
    std::ofstream(path_, std::ios::binary) << text_;
    return open_can_log(path_, offset_ns);
  }

  std::string path_ =
      testing::TempDir() + "roadvec_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".pcap";
  std::string text_;
  std::size_t link_at_ = 0;
};

TEST_F(CanCapture, gives_frames_of_every_kind_with_their_times) {
  record(100, 5, can(0x123, "\x11\x22\x33"));
  record(100, 6, can(0x12345678 | kExtended, std::string(8, '\x55')));
  record(100, 7, can(0x321, std::string(48, '\x66'), 0x04));
  record(100, 8, can(0x7FF | kRemote, ""));
  record(101, 0, can(0x40 | kError, std::string(8, '\0')));
  auto reader = open(1000);
  ASSERT_TRUE(reader) << reader.error().message;
  CanFrame frame;
  ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.id, 0x123U);
  EXPECT_EQ(frame.time.ns, 100'000'000'005 + 1000);
  EXPECT_EQ(frame.length, 3);
  EXPECT_EQ(frame.data[2], 0x33);
  EXPECT_FALSE(frame.extended || frame.fd || frame.remote || frame.error);
  ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.id, 0x12345678U);
  EXPECT_TRUE(frame.extended);
  ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_TRUE(frame.fd);
  EXPECT_EQ(frame.length, 48);
  ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_TRUE(frame.remote);
  ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_TRUE(frame.error);
  EXPECT_EQ((*reader)->read(frame, {}), CanReadResult::end);
  EXPECT_EQ((*reader)->counters().frame_count, 5U);
  EXPECT_EQ((*reader)->counters().bus_off_count, 1U);
}

TEST_F(CanCapture, passes_over_records_that_hold_no_whole_frame_and_counts_them) {
  record(1, 0, "short");
  record(1, 0, can(0x1, "\x11\x22").substr(0, 9));        // says two bytes, has one
  record(1, 0, can(0x1, std::string(65, '\x11'), 0x04));  // longer than any frame
  record(1, 0, can(0x2, "\x11"));
  auto reader = open();
  ASSERT_TRUE(reader) << reader.error().message;
  CanFrame frame;
  ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.id, 0x2U);
  EXPECT_EQ((*reader)->read(frame, {}), CanReadResult::end);
  EXPECT_EQ((*reader)->counters().wrong_size_count, 3U);
}

TEST_F(CanCapture, that_is_cut_off_ends_there) {
  record(1, 0, can(0x2, "\x11"));
  record(2, 0, can(0x3, "\x11"));
  text_.resize(text_.size() - 4);
  auto reader = open();
  ASSERT_TRUE(reader) << reader.error().message;
  CanFrame frame;
  EXPECT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ((*reader)->read(frame, {}), CanReadResult::end);
}

TEST_F(CanCapture, of_another_interface_is_refused_with_the_remedy) {
  text_[link_at_] = kEthernet;
  text_[link_at_ + 1] = 0;
  const auto reader = open();
  ASSERT_FALSE(reader);
  EXPECT_THAT(reader.error().message, HasSubstr("not of a CAN interface"));
}

TEST(CanLog, that_is_no_capture_is_read_as_text) {
  const std::string path = testing::TempDir() + "roadvec_can_text.log";
  std::ofstream(path) << "(1.000000) can0 123#11\n";
  auto reader = open_can_log(path);
  ASSERT_TRUE(reader) << reader.error().message;
  CanFrame frame;
  EXPECT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace roadvec
