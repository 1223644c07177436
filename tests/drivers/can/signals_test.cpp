#include "drivers/can/signals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tests/support/recordings.h"

namespace roadvec {
namespace {

CanFrame frame_of(std::initializer_list<unsigned> bytes) {
  CanFrame frame;
  for (const unsigned byte : bytes) frame.data[frame.length++] = static_cast<std::uint8_t>(byte);
  return frame;
}

DbcFile message_with(const std::string& signals) { return parse_dbc("BO_ 1 A: 64 X\n" + signals, "test"); }

SignalDecoder decoder_of(const DbcFile& file, std::size_t index = 0) {
  const Expected<SignalDecoder> decoder =
      SignalDecoder::create(file.messages.at(0), file.messages.at(0).signals.at(index));
  EXPECT_TRUE(decoder);
  return *decoder;
}

double physical(const std::string& position, const CanFrame& frame, const std::string& scaling = "(1,0)") {
  const DbcFile file = message_with(" SG_ S : " + position + " " + scaling + " [0|1] \"\" X\n");
  return decoder_of(file).physical(frame).value();
}

TEST(SignalDecoder, both_byte_orders_give_their_check_values) {
  const CanFrame frame = frame_of({0xAB, 0xC0, 0x23, 0x01});
  EXPECT_EQ(physical("7|12@0+", frame), 0xABC);
  EXPECT_EQ(physical("16|12@1+", frame), 0x123);
}

TEST(SignalDecoder, signed_values_are_extended_from_their_own_top_bit) {
  EXPECT_EQ(physical("0|4@1-", frame_of({0x0F})), -1.0);
  EXPECT_EQ(physical("0|4@1-", frame_of({0x08})), -8.0);
  EXPECT_EQ(physical("0|4@1-", frame_of({0xF7})), 7.0);
  EXPECT_EQ(physical("7|64@0-", frame_of({0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE})), -2.0);
  EXPECT_EQ(physical("0|1@1-", frame_of({0x01})), -1.0);
}

TEST(SignalDecoder, factor_and_offset_make_the_physical_value) {
  EXPECT_EQ(physical("7|16@0+", frame_of({0x1A, 0x6F}), "(0.01,-67.67)"), 6767 * 0.01 - 67.67);
  EXPECT_EQ(physical("0|8@1-", frame_of({0xFE}), "(-.5,0)"), 1.0);
}

TEST(SignalDecoder, floats_are_taken_bit_by_bit) {
  const DbcFile file = message_with(
      " SG_ F : 0|32@1- (2,1) [0|1] \"\" X\n SG_ D : 39|64@0- (1,0) [0|1] \"\" X\n"
      "SIG_VALTYPE_ 1 F : 1;\nSIG_VALTYPE_ 1 D : 2;\n");
  const CanFrame frame = frame_of({0, 0, 0xC0, 0x3F, 0xBF, 0xF8, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(decoder_of(file, 0).physical(frame), 1.5 * 2 + 1);
  EXPECT_EQ(decoder_of(file, 1).physical(frame), -1.5);
  const CanFrame not_a_number = frame_of({0, 0, 0xC0, 0x7F});
  EXPECT_FALSE(decoder_of(file, 0).physical(not_a_number));
  EXPECT_TRUE(decoder_of(file, 0).raw(not_a_number));
}

TEST(SignalDecoder, a_frame_that_ends_before_the_signal_has_no_value) {
  const DbcFile file = message_with(" SG_ I : 12|8@1+ (1,0) [0|1] \"\" X\n SG_ M : 3|8@0+ (1,0) [0|1] \"\" X\n");
  for (const std::size_t index : {0U, 1U}) {
    EXPECT_FALSE(decoder_of(file, index).physical(frame_of({1})));
    EXPECT_FALSE(decoder_of(file, index).fits(frame_of({1})));
  }
  EXPECT_FALSE(decoder_of(file, 0).physical(frame_of({1, 2})));
  EXPECT_TRUE(decoder_of(file, 0).physical(frame_of({1, 2, 3})));
  EXPECT_TRUE(decoder_of(file, 1).physical(frame_of({1, 2})));
}

TEST(SignalDecoder, a_multiplexed_signal_is_there_only_while_its_selector_says_so_even_if_that_comes_later) {
  const DbcFile file = message_with(" SG_ P m2 : 0|8@1+ (1,0) [0|1] \"\" X\n SG_ Sel M : 8|8@1+ (1,0) [0|1] \"\" X\n");
  EXPECT_EQ(decoder_of(file).physical(frame_of({77, 2})), 77.0);
  EXPECT_FALSE(decoder_of(file).physical(frame_of({77, 3})));
  EXPECT_FALSE(decoder_of(file).fits(frame_of({77})));
}

TEST(SignalDecoder, a_nested_signal_is_there_while_both_its_selectors_say_so) {
  const DbcFile file = message_with(
      " SG_ Outer M : 0|4@1+ (1,0) [0|1] \"\" X\n SG_ Inner m3M : 4|4@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Part m1 : 8|8@1+ (1,0) [0|1] \"\" X\nSG_MUL_VAL_ 1 Part Inner 1-2, 5-5;\n");
  const SignalDecoder part = decoder_of(file, 2);
  EXPECT_EQ(part.physical(frame_of({0x13, 77})), 77.0);
  EXPECT_EQ(part.physical(frame_of({0x23, 78})), 78.0);
  EXPECT_EQ(part.physical(frame_of({0x53, 79})), 79.0);
  EXPECT_EQ(part.physical(frame_of({0x33, 80})), std::nullopt) << "the inner selector has another value";
  EXPECT_EQ(part.physical(frame_of({0x14, 81})), std::nullopt) << "the inner selector is not in this frame";
  EXPECT_EQ(decoder_of(file, 1).physical(frame_of({0x53})), 5.0);
}

TEST(SignalDecoder, a_multiplexed_signal_of_which_nobody_says_by_what_is_refused) {
  const auto error_of = [](const std::string& signals, std::size_t index) {
    const DbcFile file = message_with(signals);
    const auto decoder = SignalDecoder::create(file.messages.at(0), file.messages[0].signals.at(index));
    return decoder ? "no error" : decoder.error().message;
  };
  EXPECT_THAT(error_of(" SG_ S m1 : 8|8@1+ (1,0) [0|1] \"\" X\n", 0), testing::HasSubstr("A.S is multiplexed"));
  EXPECT_THAT(error_of(" SG_ O M : 0|4@1+ (1,0) [0|1] \"\" X\n SG_ I m3M : 4|4@1+ (1,0) [0|1] \"\" X\n"
                       " SG_ S m1 : 8|8@1+ (1,0) [0|1] \"\" X\n",
                       2),
              testing::HasSubstr("SG_MUL_VAL_"));
  EXPECT_THAT(error_of(" SG_ A m1M : 0|4@1+ (1,0) [0|1] \"\" X\n SG_ B m1M : 4|4@1+ (1,0) [0|1] \"\" X\n"
                       "SG_MUL_VAL_ 1 A B 1-1;\nSG_MUL_VAL_ 1 B A 1-1;\n",
                       0),
              testing::HasSubstr("A.A is multiplexed"))
      << "in a circle";
}

/// The definition, bit by bit.
std::uint64_t bits_one_by_one(const DbcSignal& signal, const CanFrame& frame) {
  std::uint64_t value = 0;
  unsigned bit = signal.start_bit;
  for (unsigned i = 0; i < signal.length_bits; ++i) {
    const std::uint64_t set = (frame.data[bit / 8] >> (bit % 8)) & 1U;
    if (signal.order == ByteOrder::intel) {
      value |= set << i;
      ++bit;
    } else {
      value = value << 1 | set;
      bit = bit % 8 == 0 ? bit + 15 : bit - 1;
    }
  }
  return value;
}

TEST(BitField, agrees_with_the_definition_for_every_start_length_and_order) {
  std::mt19937 random(7);
  CanFrame frame;
  frame.length = 64;
  for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random());
  DbcSignal signal;
  for (unsigned start = 0; start < 512; start += 1) {
    for (unsigned length = 1; length <= 64; ++length) {
      for (const ByteOrder order : {ByteOrder::intel, ByteOrder::motorola}) {
        const unsigned first = order == ByteOrder::intel ? start : start / 8 * 8 + 7 - start % 8;
        if (first + length > 512) continue;
        signal.start_bit = static_cast<std::uint16_t>(start);
        signal.length_bits = static_cast<std::uint8_t>(length);
        signal.order = order;
        const BitField field = BitField::of(signal);
        ASSERT_TRUE(field.fits(frame));
        ASSERT_EQ(field.extract(frame), bits_one_by_one(signal, frame)) << start << " " << length;
      }
    }
  }
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',') {
      cells.emplace_back();
    } else if (c != '\r') {
      cells.back() += c;
    }
  }
  return cells;
}

CanFrame frame_of_hex(const std::string& digits) {
  CanFrame frame;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    std::from_chars(digits.data() + i, digits.data() + i + 2, frame.data[frame.length++], 16);
  }
  return frame;
}

TEST(SignalRecordings, every_reference_decode_of_nine_makers_is_met_exactly) {
  const auto path = recording("dbc/vectors.csv");
  if (!path) return;
  std::map<std::string, DbcFile> files;
  std::ifstream rows(*path);
  std::string row;
  std::getline(rows, row);
  std::size_t checked = 0;
  while (std::getline(rows, row)) {
    const std::vector<std::string> cells = split(row);
    ASSERT_EQ(cells.size(), 6U) << row;
    if (!files.contains(cells[0])) files[cells[0]] = *load_dbc(*recording("dbc/" + cells[0]));
    const auto& messages = files[cells[0]].messages;
    const CanId id{static_cast<std::uint32_t>(std::stoul(cells[1], nullptr, 16)), cells[2] == "1"};
    const auto message = std::find_if(messages.begin(), messages.end(), [&](const auto& m) { return m.id == id; });
    ASSERT_NE(message, messages.end()) << row;
    const auto signal = std::find_if(message->signals.begin(), message->signals.end(),
                                     [&](const auto& s) { return s.name == cells[4]; });
    ASSERT_NE(signal, message->signals.end()) << row;
    const Expected<SignalDecoder> decoder = SignalDecoder::create(*message, *signal);
    ASSERT_TRUE(decoder) << row;
    double expected = 0.0;
    std::from_chars(cells[5].data(), cells[5].data() + cells[5].size(), expected);
    const std::optional<double> value = decoder->physical(frame_of_hex(cells[3]));
    ASSERT_TRUE(value) << row;
    EXPECT_EQ(*value, expected) << row;
    ++checked;
  }
  EXPECT_EQ(checked, 3912U);
}

}  // namespace
}  // namespace roadvec
