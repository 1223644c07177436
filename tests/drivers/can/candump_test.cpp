#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <thread>

#include "drivers/can/can_log_reader.h"
#include "drivers/can/candump_line.h"
#include "tests/support/can_bytes.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

CanFrame frame_in(const std::string& line) {
  const CandumpLine parsed = parse_candump_line(line);
  EXPECT_EQ(parsed.kind, CandumpKind::frame) << line << ": " << parsed.reason;
  return parsed.frame;
}

TEST(CandumpLine, a_standard_data_frame_is_read) {
  const CandumpLine line = parse_candump_line("(1436509052.249713) can0 123#1122334455667788");
  ASSERT_EQ(line.kind, CandumpKind::frame) << line.reason;
  EXPECT_EQ(line.interface, "can0");
  EXPECT_TRUE(line.has_time);
  EXPECT_EQ(line.frame.time.ns, 1436509052249713000);
  EXPECT_EQ(line.frame.id, 0x123U);
  EXPECT_FALSE(line.frame.extended || line.frame.fd || line.frame.error || line.frame.remote);
  EXPECT_THAT(bytes_of(line.frame), testing::ElementsAre(0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88));
}

TEST(CandumpLine, times_have_six_or_nine_decimals_and_the_line_may_end_as_in_windows) {
  EXPECT_EQ(frame_in("(1436509052.249713123) vcan0 123#\r").time.ns, 1436509052249713123);
  EXPECT_EQ(frame_in("(0000000001.500000) my-bus 123#").time.ns, 1500000000);
}

TEST(CandumpLine, eight_digits_are_an_extended_id_or_an_error_frame) {
  const CanFrame extended = frame_in("(1.000000) can0 18FEF1fe#0102");
  EXPECT_TRUE(extended.extended);
  EXPECT_EQ(extended.id, 0x18FEF1FEU);
  const CanFrame error = frame_in("(1.000000) can0 20000004#0004000000000000");
  EXPECT_TRUE(error.error);
  EXPECT_FALSE(error.extended);
  EXPECT_EQ(error.id, 4U);
  EXPECT_EQ(error.length, 8);
}

TEST(CandumpLine, remote_frames_carry_the_length_they_ask_for) {
  EXPECT_TRUE(frame_in("(1.000000) can0 123#R").remote);
  EXPECT_EQ(frame_in("(1.000000) can0 123#R5").length, 5);
  EXPECT_EQ(parse_candump_line("(1.000000) can0 123#R9").kind, CandumpKind::bad);
}

TEST(CandumpLine, can_fd_frames_have_a_nibble_of_flags_and_one_of_their_lengths) {
  const CanFrame frame = frame_in("(1.000000) can0 123##1" + std::string(128, 'A'));
  EXPECT_TRUE(frame.fd);
  EXPECT_EQ(frame.length, 64);
  EXPECT_EQ(frame.data[63], 0xAA);
  EXPECT_EQ(frame_in("(1.000000) can0 123##0").length, 0);
  EXPECT_EQ(parse_candump_line("(1.000000) can0 123##1" + std::string(18, 'A')).kind, CandumpKind::bad);
  EXPECT_EQ(parse_candump_line("(1.000000) can0 123##1" + std::string(130, 'A')).kind, CandumpKind::bad);
  EXPECT_EQ(parse_candump_line("(1.000000) can0 123##").kind, CandumpKind::bad);
}

TEST(CandumpLine, dots_length_codes_and_directions_are_taken) {
  EXPECT_THAT(bytes_of(frame_in("(1.000000) can0 123#11.22.33")), testing::ElementsAre(0x11, 0x22, 0x33));
  EXPECT_EQ(frame_in("(1.000000) can0 123#1122334455667788_E").length, 8);
  EXPECT_EQ(frame_in("(1.000000) can0 123#1122 R").length, 2);
  EXPECT_EQ(frame_in("(1.000000) can0 123#1122 T").length, 2);
}

TEST(CandumpLine, the_console_form_is_read_with_and_without_time) {
  const CandumpLine bare = parse_candump_line("  can0  123   [4]  11 22 33 44");
  ASSERT_EQ(bare.kind, CandumpKind::frame) << bare.reason;
  EXPECT_FALSE(bare.has_time);
  EXPECT_THAT(bytes_of(bare.frame), testing::ElementsAre(0x11, 0x22, 0x33, 0x44));
  const CanFrame timed = frame_in(" (1436509052.249713)  can0  12345678   [2]  AA BB   '..'");
  EXPECT_TRUE(timed.extended);
  EXPECT_EQ(timed.time.ns, 1436509052249713000);
  EXPECT_EQ(timed.length, 2);
  EXPECT_EQ(frame_in("  can0  RX - -  123   [1]  11").id, 0x123U);
  EXPECT_TRUE(frame_in("  can0  123  [08]  11 22 33 44 55 66 77 88").fd);
  EXPECT_TRUE(frame_in("  can0  123   [0]  remote request").remote);
  EXPECT_TRUE(frame_in("  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME").error);
  EXPECT_EQ(frame_in("  can0  123   [0]").length, 0);
}

TEST(CandumpLine, lost_frames_and_empty_lines_are_no_bad_lines) {
  const CandumpLine lost = parse_candump_line("DROPCOUNT: dropped 12 CAN frames on 'can0' socket (total drops 14)");
  EXPECT_EQ(lost.kind, CandumpKind::drops);
  EXPECT_EQ(lost.dropped_count, 12U);
  EXPECT_EQ(parse_candump_line(" \r").kind, CandumpKind::blank);
}

TEST(CandumpLine, each_bad_line_has_its_reason) {
  for (const char* line : {"(1.000000)",
                           "(1.000000) can0",
                           "(1,000000) can0 123#11",
                           "(2020-11-05 12:34:56.123456) can0 123#11",
                           "(1.0000000000) can0 123#11",
                           "(99999999999.000000) can0 123#11",
                           "(1.000000) can0 12#11",
                           "(1.000000) can0 1234#11",
                           "(1.000000) can0 800#11",
                           "(1.000000) can0 FFFFFFFF#11",
                           "(1.000000) can0 12G#11",
                           "(1.000000) can0 123#1",
                           "(1.000000) can0 123#1G",
                           "(1.000000) can0 123#112233445566778899",
                           "(1.000000) can0 123#11..22",
                           "(1.000000) can0 123#11.",
                           "(1.000000) can0 45123#81:00:12345678#11.22",
                           "can0 123 11 22",
                           "can0 123 [2] 11",
                           "can0 123 [2] 11 22 33",
                           "can0 123 [9] 11",
                           "can0 123 [x] 11",
                           "can0 123 [] 11",
                           "nonsense"}) {
    const CandumpLine parsed = parse_candump_line(line);
    EXPECT_EQ(parsed.kind, CandumpKind::bad) << line;
    EXPECT_FALSE(parsed.reason.empty()) << line;
  }
}

class CanLogReaderTest : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  std::unique_ptr<CanLogReader> reader_of(const std::string& text, const std::string& interface = "") {
    std::ofstream(path_, std::ios::binary) << text;
    auto reader = CanLogReader::open(path_, interface);
    EXPECT_TRUE(reader);
    return *std::move(reader);
  }
  std::string path_ =
      testing::TempDir() + "roadvec_candump_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".log";
};

TEST_F(CanLogReaderTest, bad_lines_are_counted_and_the_first_is_named) {
  const auto reader = reader_of(
      "(1.000000) can0 123#11\n\nstray\n(2.000000) can0 123#2\nDROPCOUNT: dropped 3 CAN frames\n"
      "  can0  123   [1]  11\n(3.000000) can0 20000041#0000000000000000");
  CanFrame frame;
  EXPECT_EQ(reader->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.time.ns, 1000000000);
  EXPECT_EQ(reader->read(frame, {}), CanReadResult::frame);
  EXPECT_TRUE(frame.error);
  EXPECT_EQ(reader->read(frame, {}), CanReadResult::end);
  EXPECT_EQ(reader->read(frame, {}), CanReadResult::end);
  const CanCounters& counters = reader->counters();
  EXPECT_EQ(counters.frame_count, 2U);
  EXPECT_EQ(counters.bad_line_count, 3U);
  EXPECT_EQ(counters.first_bad_line, 3U);
  EXPECT_FALSE(reader->first_bad_line_reason().empty());
  EXPECT_EQ(counters.kernel_drop_count, 3U);
  EXPECT_EQ(counters.error_frame_count, 1U);
  EXPECT_EQ(counters.bus_off_count, 1U);
}

TEST_F(CanLogReaderTest, interfaces_are_numbered_or_chosen) {
  const std::string text = "(1.000000) can1 123#11\n(1.000000) can0 123#22\n(1.000000) can1 123#33\n";
  const auto all = reader_of(text);
  CanFrame frame;
  EXPECT_EQ(all->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.interface, 0);
  EXPECT_EQ(all->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.interface, 1);
  EXPECT_EQ(all->interface_name(1), "can0");
  EXPECT_EQ(all->interface_name(2), "");
  const auto one = reader_of(text, "can0");
  EXPECT_EQ(one->read(frame, {}), CanReadResult::frame);
  EXPECT_EQ(frame.data[0], 0x22);
  EXPECT_EQ(one->read(frame, {}), CanReadResult::end);
  EXPECT_EQ(one->counters().foreign_interface_count, 2U);
}

TEST_F(CanLogReaderTest, more_interfaces_than_a_car_has_are_refused_one_by_one) {
  std::string text;
  for (int i = 0; i < 20; ++i) text += "(1.000000) can" + std::to_string(i) + " 123#11\n";
  const auto reader = reader_of(text);
  CanFrame frame;
  while (reader->read(frame, {}) == CanReadResult::frame) {
  }
  EXPECT_EQ(reader->counters().frame_count, 16U);
  EXPECT_EQ(reader->counters().bad_line_count, 4U);
}

TEST_F(CanLogReaderTest, lines_across_the_buffer_and_longer_than_it_do_no_harm) {
  std::string text(200000, 'x');
  text += "\n";
  for (int i = 0; i < 5000; ++i) text += "(1.000000) can0 123#1122334455667788\n";
  const auto reader = reader_of(text);
  CanFrame frame;
  std::size_t count = 0;
  while (reader->read(frame, {}) == CanReadResult::frame) {
    ++count;
    ASSERT_EQ(frame.data[7], 0x88);
  }
  EXPECT_EQ(count, 5000U);
}

class CandumpFifoTest : public CanLogReaderTest {
 protected:
  void SetUp() override {
    std::filesystem::remove(path_);
    ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
    auto reader = CanLogReader::open(path_);  // before there is a writer: this must not wait for one
    ASSERT_TRUE(reader) << reader.error().message;
    reader_ = *std::move(reader);
  }
  void TearDown() override {
    CanLogReaderTest::TearDown();
    if (writer_ >= 0) ::close(writer_);
  }
  void writer_comes() { ASSERT_GE(writer_ = ::open(path_.c_str(), O_WRONLY | O_NONBLOCK), 0); }
  void writer_leaves() {
    ::close(writer_);
    writer_ = -1;
  }
  void write(std::string_view text) {
    ASSERT_EQ(::write(writer_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::unique_ptr<CanLogReader> reader_;
  CanFrame frame_;
  int writer_ = -1;
};

TEST_F(CandumpFifoTest, without_a_writer_it_is_quiet_for_as_long_as_it_may_wait) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  EXPECT_EQ(reader_->read(frame_, std::chrono::milliseconds(0)), CanReadResult::quiet);
  EXPECT_EQ(reader_->read(frame_, std::chrono::milliseconds(50)), CanReadResult::quiet);
  const auto waited = Clock::now() - begin;
  EXPECT_GE(waited, std::chrono::milliseconds(50));
  EXPECT_LT(waited, std::chrono::seconds(5));
}

TEST_F(CandumpFifoTest, part_of_a_line_is_kept_until_the_rest_comes) {
  writer_comes();
  write("(1.000000) can0 123#11\n(2.000000) can0 12");
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::frame);
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::quiet);
  EXPECT_EQ(reader_->read(frame_, std::chrono::milliseconds(1)), CanReadResult::quiet);
  write("3#22");
  EXPECT_EQ(reader_->read(frame_, std::chrono::milliseconds(1)), CanReadResult::quiet);
  write("33\n");
  EXPECT_EQ(reader_->read(frame_, std::chrono::milliseconds(1)), CanReadResult::frame);
  EXPECT_EQ(frame_.time.ns, 2000000000);
  EXPECT_THAT(bytes_of(frame_), testing::ElementsAre(0x22, 0x33));
  EXPECT_EQ(reader_->counters().bad_line_count, 0U);
}

TEST_F(CandumpFifoTest, a_frame_that_comes_while_it_waits_ends_the_wait) {
  writer_comes();
  std::jthread late([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    write("(1.000000) can0 123#11\n");
  });
  EXPECT_EQ(reader_->read(frame_, std::chrono::seconds(20)), CanReadResult::frame);
}

TEST_F(CandumpFifoTest, a_writer_leaves_and_another_comes) {
  writer_comes();
  write("(1.000000) can0 123#11\n");
  writer_leaves();
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::frame);
  EXPECT_EQ(reader_->read(frame_, std::chrono::milliseconds(1)), CanReadResult::quiet);
  writer_comes();
  write("(2.000000) can0 123#22\n(3.0");
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::frame);
  EXPECT_EQ(frame_.data[0], 0x22);
  writer_leaves();  // in the middle of a line, which the next one then spoils
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::quiet);
  writer_comes();
  write("(4.000000) can0 123#44\n(5.000000) can0 123#55\n");
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::frame);
  EXPECT_EQ(frame_.data[0], 0x55);
  EXPECT_EQ(reader_->counters().bad_line_count, 1U);
}

TEST_F(CandumpFifoTest, a_line_longer_than_the_buffer_does_not_stop_what_follows) {
  writer_comes();
  const std::string part(50000, 'x');  // a pipe holds 64 KiB
  for (int i = 0; i < 4; ++i) {
    write(part);
    EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::quiet);
  }
  write("\n(1.000000) can0 123#11\n");
  EXPECT_EQ(reader_->read(frame_, {}), CanReadResult::frame);
}

TEST(CanLogReader, a_file_that_cannot_be_read_is_an_error_that_names_it) {
  EXPECT_THAT(CanLogReader::open("/nowhere/can.log").error().message, HasSubstr("/nowhere/can.log"));
  EXPECT_THAT(CanLogReader::open("/").error().message, HasSubstr("folder"));
}

TEST(CandumpRecordings, every_line_of_a_recorded_minute_is_a_frame) {
  const auto path = recording("comma2k19/can.log");
  if (!path) return;
  auto reader = CanLogReader::open(*path);
  ASSERT_TRUE(reader);
  CanFrame frame;
  while ((*reader)->read(frame, {}) == CanReadResult::frame) {
  }
  EXPECT_EQ((*reader)->counters().frame_count, 98800U);
  EXPECT_EQ((*reader)->counters().bad_line_count, 0U);
}

}  // namespace
}  // namespace roadvec
