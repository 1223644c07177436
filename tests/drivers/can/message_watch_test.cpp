#include "drivers/can/message_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "drivers/can/can_log_reader.h"
#include "drivers/can/candump_line.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

CanFrame frame_of(const std::string& text) {
  const CandumpLine line = parse_candump_line("(1.000000) can0 " + text);
  EXPECT_EQ(line.kind, CandumpKind::frame) << line.reason;
  return line.frame;
}

/// A message with an eight-bit checksum in its last byte and a four-bit counter in its first.
const DbcFile& file() {
  static const DbcFile parsed = parse_dbc(
      "BO_ 608 A: 8 X\n SG_ Sum : 63|8@0+ (1,0) [0|255] \"\" X\n SG_ Count : 0|4@1+ (1,0) [0|15] \"\" X\n", "a.dbc");
  return parsed;
}

Expected<MessageWatch> watch_of(const MessageCheck& check) {
  MessageWatch watch(file().messages.at(0));
  const Expected<void> added = watch.add(file(), check);
  if (!added) return fail(added.error().message);
  return watch;
}

MessageCheck check_of(const std::string& counter, const std::string& checksum, ChecksumKind kind) {
  MessageCheck check;
  check.message = "A";
  check.counter = counter;
  check.checksum = checksum;
  check.kind = kind;
  return check;
}

TEST(MessageWatch, a_frame_with_a_wrong_checksum_is_dropped_and_counted) {
  auto watch = watch_of(check_of("", "Sum", ChecksumKind::toyota));
  ASSERT_TRUE(watch);
  MessageCounters counters;
  // 0x02 + 0x60 + 8 + 1 + 2 + 3 + 4 + 5 + 6 + 7 = 0x86
  EXPECT_TRUE(watch->accept(frame_of("260#0102030405060786"), counters));
  EXPECT_EQ(counters.bad_checksum_count, 0U);
  EXPECT_FALSE(watch->accept(frame_of("260#0102030405060787"), counters));
  EXPECT_FALSE(watch->accept(frame_of("260#01020304050607"), counters));
  EXPECT_EQ(counters.bad_checksum_count, 2U);
}

TEST(MessageWatch, a_counter_that_does_not_follow_on_is_a_gap_and_its_turn_is_none) {
  auto watch = watch_of(check_of("Count", "", ChecksumKind::none));
  ASSERT_TRUE(watch);
  MessageCounters counters;
  for (const char* frame : {"260#0D", "260#0E", "260#0F", "260#00", "260#01"}) {
    EXPECT_TRUE(watch->accept(frame_of(frame), counters));
  }
  EXPECT_EQ(counters.counter_gap_count, 0U);
  EXPECT_TRUE(watch->accept(frame_of("260#03"), counters));
  EXPECT_TRUE(watch->accept(frame_of("260#03"), counters)) << "repeated: a gap too, but the values are used";
  EXPECT_EQ(counters.counter_gap_count, 2U);
}

TEST(MessageWatch, half_a_checksum_and_signals_that_are_not_there_are_refused) {
  EXPECT_THAT(watch_of(check_of("", "Sum", ChecksumKind::none)).error().message, HasSubstr("kind"));
  EXPECT_THAT(watch_of(check_of("", "", ChecksumKind::honda)).error().message, HasSubstr("kind"));
  EXPECT_THAT(watch_of(check_of("Cont", "", ChecksumKind::none)).error().message, HasSubstr("near it: Count"));
  EXPECT_THAT(watch_of(check_of("", "Sum", ChecksumKind::vw_mqb)).error().message, HasSubstr("0x86"));
}

std::uint64_t checksum(ChecksumKind kind, const std::string& text) { return checksum_of(kind, frame_of(text)).value(); }

TEST(Checksum, sums_are_those_added_by_hand) {
  EXPECT_EQ(checksum(ChecksumKind::toyota, "260#0102030405060700"), 0x86U);
  // 0x75 + 0x01 + 0x11 + 0x22 = 0xA9
  EXPECT_EQ(checksum(ChecksumKind::tesla, "175#1122"), 0xA9U);
  // 1 + 13 + 0 + (1 + 2) + (3 + 0) = 20; 8 - 20 = -12 = 4 mod 16
  EXPECT_EQ(checksum(ChecksumKind::honda, "1D0#1230"), 4U);
  // 1 + 13 + 0 + 0 + 3: 8 + 3 - 17 = -6 = 10 mod 16
  EXPECT_EQ(checksum(ChecksumKind::honda, "00001D00#0030"), 10U);
}

// Frames that a car sent.
TEST(Checksum, frames_of_a_honda_agree) {
  EXPECT_EQ(checksum(ChecksumKind::honda, "1DC#0202CB10"), 2U);
  EXPECT_EQ(checksum(ChecksumKind::honda, "324#7D65146F00000010"), 5U);
}

/// Divides bit by bit as one long polynomial: the definition, where the code runs byte by byte.
std::uint64_t remainder(const std::vector<std::uint8_t>& bytes, unsigned width, std::uint64_t polynomial,
                        std::uint64_t first) {
  std::uint64_t rest = first;
  for (const std::uint8_t byte : bytes) {
    for (int bit = 7; bit >= 0; --bit) {
      const bool top = (rest >> (width - 1) & 1) != static_cast<unsigned>(byte >> bit & 1);
      rest = rest << 1 & ((std::uint64_t{1} << width) - 1);
      if (top) rest ^= polynomial;
    }
  }
  return rest;
}

TEST(Checksum, cyclic_sums_are_the_remainders_of_data_id_and_constant) {
  EXPECT_EQ(remainder({'1', '2', '3', '4', '5', '6', '7', '8', '9'}, 16, 0x1021, 0), 0x31C3U) << "CRC-16/XMODEM";
  EXPECT_EQ(remainder({'1', '2', '3', '4', '5', '6', '7', '8', '9'}, 8, 0x2F, 0xFF) ^ 0xFF, 0xDFU) << "CRC-8/AUTOSAR";
  EXPECT_EQ(checksum(ChecksumKind::hyundai_canfd, "125#0000010203040506"),
            remainder({1, 2, 3, 4, 5, 6, 0x25, 0x01}, 16, 0x1021, 0) ^ 0x5F29);
  EXPECT_EQ(checksum(ChecksumKind::hyundai_canfd, "125##100000102030405060708090A0B0C0D0E"),
            remainder({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 0x25, 0x01}, 16, 0x1021, 0) ^ 0x041D);
  EXPECT_EQ(checksum(ChecksumKind::vw_mqb, "086#00F1020304050607"),
            remainder({0xF1, 2, 3, 4, 5, 6, 7, 0x86}, 8, 0x2F, 0xFF) ^ 0xFF);
  EXPECT_FALSE(checksum_of(ChecksumKind::hyundai_canfd, frame_of("125##100000102030405060708090A")));
  EXPECT_FALSE(checksum_of(ChecksumKind::vw_mqb, frame_of("0FD#00F1020304050607")));
}

TEST(MessageRecordings, a_toyota_that_drives_for_a_minute_sends_no_wrong_checksum) {
  const auto log = recording("comma2k19/can.log");
  if (!log) return;
  const Expected<DbcFile> dbc = load_dbc(*recording("comma2k19/toyota_rav4_2017_pt_generated.dbc"));
  ASSERT_TRUE(dbc) << dbc.error().message;
  std::map<std::uint32_t, MessageWatch> watches;
  for (const char* name : {"STEER_TORQUE_SENSOR", "SPEED", "PCM_CRUISE"}) {
    const auto signal = find_signal(*dbc, std::string(name) + ".CHECKSUM");
    ASSERT_TRUE(signal) << signal.error().message;
    MessageCheck check = check_of("", "CHECKSUM", ChecksumKind::toyota);
    check.message = name;
    const auto watch = watches.emplace(signal->message->id.id, *signal->message).first;
    ASSERT_TRUE(watch->second.add(*dbc, check));
  }
  auto reader = CanLogReader::open(*log, "can0");
  ASSERT_TRUE(reader) << reader.error().message;
  MessageCounters counters;
  std::size_t accepted_count = 0;
  CanFrame frame;
  while ((*reader)->read(frame, {}) == CanReadResult::frame) {
    const auto watch = watches.find(frame.id);
    if (watch != watches.end() && watch->second.accept(frame, counters)) ++accepted_count;
  }
  EXPECT_EQ(counters.bad_checksum_count, 0U);
  EXPECT_GT(accepted_count, 5000U);
}

}  // namespace
}  // namespace roadvec
