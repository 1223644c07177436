#include "drivers/can/dbc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/support/recordings.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

constexpr const char* kHead = "VERSION \"\"\n\nNS_ :\n\tCM_\n\tSIG_VALTYPE_\n\nBS_:\n\nBU_: EPS\n ABS\n\n";

DbcFile parse(const std::string& body) { return parse_dbc(kHead + body, "car.dbc"); }

const DbcSignal& only_signal(const DbcFile& file) {
  EXPECT_EQ(file.messages.size(), 1U);
  EXPECT_EQ(file.messages.at(0).signals.size(), 1U);
  return file.messages.at(0).signals.at(0);
}

TEST(Dbc, a_message_with_its_signals_is_read) {
  const DbcFile file = parse(
      "BO_ 194 SteeringSensor: 4 EPS\n"
      " SG_ Angle : 7|16@0- (0.1,-3.5) [-800|800] \"deg\" ABS\n"
      " SG_ Counter: 24|4@1+ (1,0) [0|15] \"\" ABS\n");
  EXPECT_TRUE(file.diagnostics.empty());
  ASSERT_EQ(file.messages.size(), 1U);
  const DbcMessage& message = file.messages[0];
  EXPECT_EQ(message.name, "SteeringSensor");
  EXPECT_EQ(message.id, (CanId{194, false}));
  EXPECT_EQ(message.length_bytes, 4);
  ASSERT_EQ(message.signals.size(), 2U);
  const DbcSignal& angle = message.signals[0];
  EXPECT_EQ(angle.name, "Angle");
  EXPECT_EQ(angle.start_bit, 7);
  EXPECT_EQ(angle.length_bits, 16);
  EXPECT_EQ(angle.order, ByteOrder::motorola);
  EXPECT_EQ(angle.coding, SignalCoding::signed_integer);
  EXPECT_EQ(angle.factor, 0.1);
  EXPECT_EQ(angle.offset, -3.5);
  EXPECT_EQ(angle.unit, "deg");
  EXPECT_EQ(message.signals[1].order, ByteOrder::intel);
  EXPECT_EQ(message.signals[1].coding, SignalCoding::unsigned_integer);
}

TEST(Dbc, numbers_may_lack_a_leading_zero_or_carry_signs_exponents_and_blanks) {
  const DbcFile file = parse("BO_ 1 A: 8 X\n SG_ S : 0 | 8 @1+ ( -.25 , +1E-05 ) [0|1] \"\" X\n");
  EXPECT_TRUE(file.diagnostics.empty());
  EXPECT_EQ(only_signal(file).factor, -0.25);
  EXPECT_EQ(only_signal(file).offset, 1e-05);
}

TEST(Dbc, bit_31_of_the_id_marks_29_bit_identifiers) {
  const DbcFile file = parse("BO_ 2566844926 Eec1: 8 X\n");
  ASSERT_EQ(file.messages.size(), 1U);
  EXPECT_EQ(file.messages[0].id, (CanId{0x18FEF1FE, true}));
  EXPECT_TRUE(file.diagnostics.empty());
}

TEST(Dbc, an_id_beyond_11_bits_without_the_flag_is_read_as_extended_and_reported) {
  const DbcFile file = parse("BO_ 4096 A: 8 X\n");
  ASSERT_EQ(file.messages.size(), 1U);
  EXPECT_EQ(file.messages[0].id, (CanId{4096, true}));
  ASSERT_EQ(file.diagnostics.size(), 1U);
  EXPECT_THAT(file.diagnostics[0].text, HasSubstr("car.dbc:12: id has more than 11 bits"));
}

TEST(Dbc, names_that_begin_with_a_digit_are_kept) {
  const DbcFile file = parse("BO_ 5 2017_5: 8 X\n SG_ 64_BIT_LE : 0|64@1+ (1,0) [0|1] \"\" X\n");
  EXPECT_EQ(file.messages.at(0).name, "2017_5");
  EXPECT_EQ(only_signal(file).name, "64_BIT_LE");
  EXPECT_TRUE(file.diagnostics.empty());
}

TEST(Dbc, the_pseudo_message_of_unassigned_signals_is_ignored) {
  const DbcFile file = parse(
      "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector\n"
      " SG_ Lost : 0|8@1+ (1,0) [0|0] \"\" Vector\n");
  EXPECT_TRUE(file.messages.empty());
  EXPECT_TRUE(file.diagnostics.empty());
}

TEST(Dbc, multiplexing_is_read_in_its_three_forms) {
  const DbcFile file = parse(
      "BO_ 1 A: 8 X\n"
      " SG_ Select M : 0|4@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Part m3 : 8|8@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Nested m12M : 16|8@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Wrong q1 : 16|8@1+ (1,0) [0|1] \"\" X\n");
  ASSERT_EQ(file.messages.at(0).signals.size(), 3U);
  const auto& signals = file.messages[0].signals;
  EXPECT_TRUE(signals[0].is_selector);
  EXPECT_TRUE(signals[0].multiplex_values.empty());
  EXPECT_FALSE(signals[1].is_selector);
  EXPECT_EQ(signals[1].multiplex_values.at(0).last, 3U);
  EXPECT_TRUE(signals[2].is_selector);
  EXPECT_EQ(signals[2].multiplex_values.at(0).first, 12U);
  EXPECT_EQ(file.diagnostics.size(), 1U);
}

TEST(Dbc, extended_multiplexing_names_the_selector_and_the_ranges_of_its_values) {
  const DbcFile file = parse(
      "BO_ 1 A: 8 X\n"
      " SG_ Outer M : 0|4@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Inner m3M : 4|4@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Part m1 : 8|8@1+ (1,0) [0|1] \"\" X\n"
      "SG_MUL_VAL_ 1 Inner Outer 3-3;\nSG_MUL_VAL_ 1 Part Inner 1-3, 5-5 ;\n"
      "SG_MUL_VAL_ 1 Part Nobody 1-3;\nSG_MUL_VAL_ 1 Part Inner 1;\nSG_MUL_VAL_ Part;\n");
  const auto& signals = file.messages.at(0).signals;
  EXPECT_EQ(signals.at(1).selector, "Outer");
  EXPECT_EQ(signals.at(2).selector, "Inner");
  ASSERT_EQ(signals[2].multiplex_values.size(), 2U);
  EXPECT_EQ(signals[2].multiplex_values[0].last, 3U);
  EXPECT_EQ(signals[2].multiplex_values[1].first, 5U);
  EXPECT_EQ(file.diagnostics.size(), 3U);
}

TEST(Dbc, the_cycle_time_is_the_messages_own_or_the_files_default) {
  const DbcFile file = parse(
      "BO_ 1 A: 8 X\nBO_ 2147483650 B: 8 X\n"
      "BA_DEF_ BO_  \"GenMsgCycleTime\" INT 0 65535;\nBA_DEF_DEF_  \"GenMsgCycleTime\" 100;\n"
      "BA_DEF_DEF_ \"Other\" \"text\";\nBA_ \"GenMsgCycleTime\" BO_ 2147483650 20;\n"
      "BA_ \"GenMsgCycleTime\" BO_ 9 20;\nBA_ \"GenMsgCycleTime\" SG_ 1 S 20;\n");
  EXPECT_EQ(file.messages.at(0).cycle_time_ms, 100U);
  EXPECT_EQ(file.messages.at(1).cycle_time_ms, 20U);
  EXPECT_EQ(file.diagnostics.size(), 2U);
}

TEST(Dbc, floats_are_told_apart_by_their_value_type_with_or_without_colon) {
  const DbcFile file = parse(
      "BO_ 1 A: 16 X\n"
      " SG_ Single : 0|32@1- (1,0) [0|1] \"\" X\n"
      " SG_ Double : 64|64@1- (1,0) [0|1] \"\" X\n"
      "SIG_VALTYPE_ 1 Single : 1;\nSIG_VALTYPE_ 1 Double 2;\nSIG_VALTYPE_ 1 Double : 1;\nSIG_VALTYPE_ 1 None : 1;\n");
  EXPECT_EQ(file.messages.at(0).signals.at(0).coding, SignalCoding::float32);
  EXPECT_EQ(file.messages.at(0).signals.at(1).coding, SignalCoding::float64);
  ASSERT_EQ(file.diagnostics.size(), 2U);
  EXPECT_EQ(file.diagnostics[0].line, 17U);
  EXPECT_EQ(file.diagnostics[1].line, 18U);
}

TEST(Dbc, windows_line_ends_and_letters_of_cp1252_are_taken) {
  const DbcFile file = parse(
      "BO_ 1 T\xFCr: 8 X\r\n SG_ Winkel : 0|8@1+ (1,0) [0|1] \"\xB0\" X\r\nCM_ \"Gr\xF6\xDF"
      "e\";\r\n");
  EXPECT_TRUE(file.diagnostics.empty());
  EXPECT_EQ(file.messages.at(0).name, "T\xFCr");
  EXPECT_EQ(only_signal(file).unit, "\xB0");
}

TEST(Dbc, strings_may_span_lines_and_look_like_anything) {
  const DbcFile file = parse(
      "BO_ 1 A: 8 X\n"
      "CM_ BO_ 1 \"first line\n"
      "Primary axis: a \\\"quoted\\\" word\n"
      "  BO_ is not a message here\";\n"
      " SG_ S : 0|8@1+ (1,0) [0|1] \"\" X\n"
      "stray\n");
  EXPECT_EQ(only_signal(file).name, "S");
  ASSERT_EQ(file.diagnostics.size(), 1U);
  EXPECT_EQ(file.diagnostics[0].text, "car.dbc:17: no DBC statement begins like this; left out");
}

TEST(Dbc, a_string_that_is_not_closed_costs_its_own_line_only) {
  const DbcFile file = parse(
      "CM_ \"never closed;\n"
      "BO_ 1 A: 8 X\n"
      " SG_ S : 0|8@1+ (1,0) [0|1] \"km/h\" X\n"
      "CM_ SG_ 1 S \"closed\";\n");
  EXPECT_EQ(only_signal(file).unit, "km/h");
  ASSERT_EQ(file.diagnostics.size(), 1U);
  EXPECT_EQ(file.diagnostics[0].line, 12U);
}

TEST(Dbc, quotes_that_pair_with_nothing_cost_no_time) {
  std::string text;
  for (int i = 0; i < 50000; ++i) text += "\\\"\n";
  EXPECT_EQ(parse_dbc(text, "a").diagnostics.size(), 50000U);  // in no time, or the test runs into its limit
}

TEST(Dbc, comments_without_their_object_and_value_tables_are_passed_over) {
  const DbcFile file = parse(
      "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|1] \"\" X\n"
      "CM_ SG_ 1 \"no signal\";\nCM_ 145 \"no object\";\nVAL_ 1 S 1 \"one\" 2 \"two\"\nVAL_ 1 S 0 \"a\"\n 1 \"b\" ;\n"
      "VAL_TABLE_ T 0 \"x\" ;\nBA_ \"GenSigStartValue\" SG_ 1 S 10;\nBA_ \"VFrameFormat\" BO_ 1 14;\n");
  EXPECT_TRUE(file.diagnostics.empty());
  EXPECT_EQ(only_signal(file).name, "S");
}

TEST(Dbc, templates_are_told_apart_from_finished_files) {
  const DbcFile file = parse("CM_ \"IMPORT _base.dbc\";\n");
  ASSERT_EQ(file.diagnostics.size(), 1U);
  EXPECT_THAT(file.diagnostics[0].text, HasSubstr("generate the full file"));
}

TEST(Dbc, each_bad_line_costs_itself_and_one_diagnostic) {
  const DbcFile file = parse(
      "BO_ 1 A: 8 X\n"
      " SG_ NoColon 0|8@1+ (1,0) [0|1] \"\" X\n"
      " SG_ : 0|8@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Order : 0|8@2+ (1,0) [0|1] \"\" X\n"
      " SG_ Sign : 0|8@1 (1,0) [0|1] \"\" X\n"
      " SG_ Empty : 0|0@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Long : 0|65@1+ (1,0) [0|1] \"\" X\n"
      " SG_ Far : 57|8@1+ (1,0) [0|1] \"\" X\n"
      " SG_ FarToo : 56|2@0+ (1,0) [0|1] \"\" X\n"
      " SG_ Factor : 0|8@1+ (nan,0) [0|1] \"\" X\n"
      " SG_ Offset : 0|8@1+ (1) [0|1] \"\" X\n"
      " SG_ Unit : 0|8@1+ (1,0) [0|1]\n"
      " SG_ Range : 0|8@1+ (1,0) \"\" X\n"
      " SG_ Good : 56|8@1+ (1,0) [0|1] \"\" X\n");
  EXPECT_EQ(only_signal(file).name, "Good");
  ASSERT_EQ(file.diagnostics.size(), 12U);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(file.diagnostics[i].line, 13 + i) << file.diagnostics[i].text;
}

TEST(Dbc, a_bad_message_takes_its_signals_with_it_and_leaves_the_next) {
  const DbcFile file = parse(
      " SG_ Early : 0|8@1+ (1,0) [0|1] \"\" X\n"
      "BO_ 1 A: 1785 X\n SG_ S : 0|8@1+ (1,0) [0|1] \"\" X\n"
      "BO_ x A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|1] \"\" X\n"
      "BO_ 3758096384 A: 8 X\n"
      "BO_ 2 A 8 X\n"
      "BO_ 3 B: 8 X\n SG_ S : 0|8@1+ (1,0) [0|1] \"\" X\n");
  EXPECT_EQ(only_signal(file).name, "S");
  EXPECT_EQ(file.messages[0].name, "B");
  EXPECT_EQ(file.diagnostics.size(), 5U);
}

TEST(Dbc, the_last_line_needs_no_end_and_a_byte_order_mark_is_no_text) {
  const DbcFile file = parse_dbc(
      "\xEF\xBB\xBF"
      "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|1] \"\" X",
      "a");
  EXPECT_EQ(only_signal(file).name, "S");
  EXPECT_TRUE(file.diagnostics.empty());
  EXPECT_TRUE(parse_dbc("", "a").messages.empty());
}

TEST(Dbc, a_missing_file_is_an_error_that_names_it) {
  const Expected<DbcFile> file = load_dbc("/nowhere/car.dbc");
  ASSERT_FALSE(file);
  EXPECT_THAT(file.error().message, HasSubstr("/nowhere/car.dbc"));
  EXPECT_FALSE(load_dbc("/"));
}

TEST(FindSignal, says_what_is_near_a_name_that_is_not_there) {
  const DbcFile file = parse(
      "BO_ 1 WHEEL_SPEEDS: 8 X\n SG_ SPEED_FL : 0|8@1+ (1,0) [0|1] \"\" X\n SG_ SPEED_FR : 8|8@1+ (1,0) [0|1] \"\" X\n"
      "BO_ 2 BRAKE: 8 X\n");
  const Expected<DbcSignalRef> found = find_signal(file, "WHEEL_SPEEDS.SPEED_FR");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->message->id.id, 1U);
  EXPECT_EQ(found->signal->start_bit, 8);
  EXPECT_THAT(find_signal(file, "WheelSpeeds.SPEED_FR").error().message, HasSubstr("near it: WHEEL_SPEEDS"));
  EXPECT_THAT(find_signal(file, "WHEEL_SPEEDS.SpeedFl").error().message, HasSubstr("near it: SPEED_FL, SPEED_FR"));
  EXPECT_THAT(find_signal(file, "BRAKE.X").error().message, HasSubstr("it has none"));
  EXPECT_THAT(find_signal(file, "SPEED_FR").error().message, HasSubstr("write Message.Signal"));
}

TEST(DbcRecordings, a_file_full_of_odd_names_with_one_signal_beyond_its_message_loads_all_but_that) {
  const auto path = recording("dbc/mazda_2017.dbc");
  if (!path) return;
  const Expected<DbcFile> file = load_dbc(*path);
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->diagnostics.size(), 1U);
  EXPECT_EQ(file->diagnostics[0].text, *path + ":290: the signal ends beyond its message; left out");
  std::size_t signals = 0;
  for (const DbcMessage& message : file->messages) signals += message.signals.size();
  EXPECT_EQ(file->messages.size(), 102U);
  EXPECT_EQ(signals, 514U) << "of 515";
  EXPECT_TRUE(
      std::any_of(file->messages.begin(), file->messages.end(), [](const auto& m) { return m.name == "2017_5"; }));
}

TEST(DbcRecordings, the_files_of_the_other_makers_load_without_a_diagnostic) {
  if (!recording("dbc")) return;
  for (const char* name :
       {"bmw_e9x_e8x", "ford_lincoln_base_pt", "gm_global_a_powertrain_expansion", "mercedes_benz_e350_2010",
        "tesla_model3_party", "toyota_adas", "volvo_v40_2017_pt", "vw_mqb"}) {
    const Expected<DbcFile> file = load_dbc(*recording(std::string("dbc/") + name + ".dbc"));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_FALSE(file->messages.empty());
    for (const DbcDiagnostic& diagnostic : file->diagnostics) ADD_FAILURE() << diagnostic.text;
  }
  const Expected<DbcFile> file = load_dbc(*recording("dbc/vw_meb.dbc"));
  ASSERT_TRUE(file);
  ASSERT_EQ(file->diagnostics.size(), 1U);
  EXPECT_THAT(file->diagnostics[0].text, HasSubstr("vw_meb.dbc:1: a template"));
}

}  // namespace
}  // namespace roadvec
