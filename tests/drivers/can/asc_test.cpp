#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/can/asc_line.h"
#include "drivers/can/can_log_reader.h"
#include "tests/support/can_bytes.h"

namespace roadvec {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t kDate_ns = 1601478373'191'000'000;  // 2020-09-30 15:06:13.191

/// The last line of `text`, read behind those before it.
CandumpLine last_of(const std::string& text) {
  AscLines asc;
  std::size_t begin = 0;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', begin)) {
    EXPECT_NE(asc.parse(std::string_view(text).substr(begin, end - begin)).kind, CandumpKind::bad);
    begin = end + 1;
  }
  static std::string last;  // the interface of the result points into it
  last = text.substr(begin);
  return asc.parse(last);
}

TEST(AscLines, a_classic_frame_is_read_in_hexadecimal_with_its_date) {
  const CandumpLine line = last_of(
      "date Wed Sep 30 15:06:13.191 2020\nbase hex  timestamps absolute\ninternal events logged\n// version 13.0.0\n"
      "Begin Triggerblock Wed Sep 30 15:06:13.191 2020\n   0.000000 Start of measurement\n"
      "   1.015991 1  1A3             Rx   d 3 0A 1b FF  Length = 242015 BitCount = 125 ID = 419");
  ASSERT_EQ(line.kind, CandumpKind::frame) << line.reason;
  EXPECT_EQ(line.interface, "1");
  EXPECT_EQ(line.frame.id, 0x1A3U);
  EXPECT_FALSE(line.frame.extended || line.frame.fd || line.frame.remote || line.frame.error);
  EXPECT_THAT(bytes_of(line.frame), ElementsAre(0x0A, 0x1B, 0xFF));
  EXPECT_EQ(line.frame.time.ns, kDate_ns + 1'015'991'000);
}

TEST(AscLines, decimal_numbers_and_relative_times_are_what_the_head_says) {
  const CandumpLine line = last_of(
      "base dec  timestamps relative\n0.5 2 419337332x Tx d 2 10 255\n0.25 CAN 2 Status:chip status error active\n"
      "0.25 2 419337332x Tx d 2 10 255");
  ASSERT_EQ(line.kind, CandumpKind::frame) << line.reason;
  EXPECT_EQ(line.frame.id, 419337332U);
  EXPECT_TRUE(line.frame.extended);
  EXPECT_THAT(bytes_of(line.frame), ElementsAre(10, 255));
  EXPECT_EQ(line.frame.time.ns, 1'000'000'000);
}

TEST(AscLines, can_fd_frames_are_read_with_and_without_the_messages_name) {
  for (const char* name : {"", "WHEEL_SPEEDS "}) {
    const CandumpLine line =
        last_of(std::string("1.0 CANFD   1 Rx        a0  ") + name +
                "1 0 9 12 01 02 03 04 05 06 07 08 09 0a 0b 0c   130000  130 303000 e0006659 46500250 4b140250");
    ASSERT_EQ(line.kind, CandumpKind::frame) << line.reason;
    EXPECT_TRUE(line.frame.fd);
    EXPECT_EQ(line.frame.id, 0xA0U);
    EXPECT_EQ(line.interface, "1");
    EXPECT_EQ(line.frame.length, 12);
    EXPECT_EQ(line.frame.data[11], 0x0C);
  }
}

TEST(AscLines, remote_and_error_frames_are_told_apart) {
  const CandumpLine remote = last_of("1.0 1 123 Rx r");
  EXPECT_TRUE(remote.frame.remote);
  EXPECT_EQ(last_of("1.0 1 123 Rx r 4").frame.length, 4);
  for (const char* text :
       {"1.0 1 ErrorFrame", "1.0 1  ErrorFrame ECC: 10100010", "1.0 CANFD 1 Rx ErrorFrame Not Acknowledge"}) {
    const CandumpLine error = last_of(text);
    EXPECT_EQ(error.kind, CandumpKind::frame) << text;
    EXPECT_TRUE(error.frame.error) << text;
  }
}

TEST(AscLines, dates_are_english_or_german_with_twelve_hours_or_twenty_four_and_others_are_none) {
  const auto time_of = [](const std::string& date) {
    return last_of("date " + date + "\n0.0 1 123 Rx d 0").frame.time.ns;
  };
  EXPECT_EQ(time_of("Wed Sep 30 03:06:13.191 pm 2020"), kDate_ns);
  EXPECT_EQ(time_of("Mit Sep 30 15:06:13.191 2020"), kDate_ns);
  EXPECT_EQ(time_of("Fr Okt 30 15:06:13.191 2020"), kDate_ns + 30 * 86400'000'000'000);
  EXPECT_EQ(time_of("Mon M\xC3\xA4r 2 00:00:00 2020"), 1583107200'000'000'000);
  EXPECT_EQ(time_of("mer. sept. 30 15:06:13.191 2020"), 0);
  EXPECT_EQ(time_of("Wed Sep 31 15:06:13.191 2020"), 0);
  EXPECT_EQ(time_of("rubbish"), 0);
}

TEST(AscLines, other_events_are_passed_over_and_broken_frames_are_bad) {
  for (const char* text :
       {"", "End TriggerBlock", "0.1 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%", "0.1 log trigger event",
        "0.1 1 123 TxRq d 1 00", "0.1 SV: 1 0 1 ::Signal = 5", "//0.1 comment"}) {
    EXPECT_EQ(last_of(text).kind, CandumpKind::blank) << text;
  }
  for (const char* text : {"0.1 1 123 Rx d 3 00 11", "0.1 1 12345 Rx d 0", "0.1 1 123 Rx d 1 100", "0.1 1 123 Rx q 0",
                           "0.1 CANFD 1 Rx 123 1 0 9 65 00", "0.1 CANFD 1 Rx 123 1 0 9 2 00", "(1.0) can0 123#00"}) {
    EXPECT_EQ(last_of(text).kind, CandumpKind::bad) << text;
  }
}

class LogContentTest : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  Expected<std::unique_ptr<CanLogReader>> open(const std::string& text, std::int64_t offset_ns = 0) {
    std::ofstream(path_, std::ios::binary) << text;
    return CanLogReader::open(path_, "", offset_ns);
  }
  std::string path_ =
      testing::TempDir() + "roadvec_log_" + testing::UnitTest::GetInstance()->current_test_info()->name();
};

TEST_F(LogContentTest, the_content_says_which_kind_of_log_it_is) {
  const std::pair<const char*, std::int64_t> logs[] = {
      {"date Wed Sep 30 15:06:13.191 2020\nbase hex timestamps absolute\n1.0 1 123 Rx d 1 11\n",
       kDate_ns + 1'000'000'000},
      {"half a line\n(2.000000) can0 123#11\n", 2'000'000'000},
      {" (003.000000)  can0  123   [1]  11\n", 3'000'000'000}};
  for (const auto& [text, time_ns] : logs) {
    auto reader = open(text, 5);
    ASSERT_TRUE(reader) << reader.error().message;
    CanFrame frame;
    ASSERT_EQ((*reader)->read(frame, {}), CanReadResult::frame);
    EXPECT_EQ(frame.id, 0x123U);
    EXPECT_EQ(frame.time.ns, time_ns + 5) << "with the offset";
    EXPECT_EQ((*reader)->read(frame, {}), CanReadResult::end);
  }
}

TEST_F(LogContentTest, other_files_are_refused_by_name_or_with_their_first_line) {
  EXPECT_THAT(open("LOGG\x90").error().message, HasSubstr("is Vector BLF, which is not read: convert it to ASC"));
  EXPECT_THAT(open("Time,ID\x01,Data\n1,2,3\n").error().message, HasSubstr("it begins with 'Time,ID.,Data'"));
  EXPECT_TRUE(open(""));
}

}  // namespace
}  // namespace roadvec
