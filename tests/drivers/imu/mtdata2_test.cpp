#include "drivers/imu/mtdata2.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/support/recordings.h"

namespace roadvec {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Bytes big_endian(std::uint64_t value, int size) {
  Bytes bytes;
  for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  return bytes;
}

Bytes item(unsigned id, const Bytes& data) { return big_endian(id, 2) + big_endian(data.size(), 1) + data; }

Bytes message(const Bytes& content, std::uint8_t kind = 0x36) {
  Bytes bytes = {0xFF, kind};
  bytes = bytes + (content.size() < 255 ? big_endian(content.size(), 1) : Bytes{0xFF} + big_endian(content.size(), 2));
  bytes = bytes + content;
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  bytes.push_back(static_cast<std::uint8_t>(0x100 - (sum & 0xFF)));
  return Bytes{0xFA} + bytes;
}

Bytes counted(std::uint16_t counter) { return message(item(0x1020, big_endian(counter, 2))); }

std::vector<XsensSample> samples_of(Mtdata2Parser& parser, std::span<const std::uint8_t> bytes) {
  std::vector<XsensSample> samples;
  XsensSample sample;
  while (parser.next(bytes, sample)) samples.push_back(sample);
  EXPECT_TRUE(bytes.empty());
  return samples;
}

XsensSample only_sample(const Bytes& bytes) {
  Mtdata2Parser parser;
  const std::vector<XsensSample> samples = samples_of(parser, bytes);
  EXPECT_EQ(samples.size(), 1U);
  EXPECT_EQ(parser.counters().malformed_item_count, 0U);
  EXPECT_EQ(parser.counters().skipped_byte_count, 0U);
  return samples.at(0);
}

/// 1.5, -2.25, 0.5 in each precision.
Bytes vector_in(unsigned precision) {
  Bytes bytes;
  for (const double value : {1.5, -2.25, 0.5}) {
    const auto fixed = static_cast<std::int64_t>(value * 4294967296.0);
    switch (precision) {
      case 0:
        bytes = bytes + big_endian(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
        break;
      case 1:
        bytes = bytes + big_endian(static_cast<std::uint64_t>(fixed / 4096), 4);
        break;
      case 2:
        bytes = bytes + big_endian(static_cast<std::uint64_t>(fixed) & 0xFFFFFFFF, 4) +
                big_endian(static_cast<std::uint64_t>(fixed) >> 32, 2);
        break;
      default:
        bytes = bytes + big_endian(std::bit_cast<std::uint64_t>(value), 8);
        break;
    }
  }
  return bytes;
}

TEST(Mtdata2, every_item_is_read_in_each_of_the_four_precisions) {
  for (const unsigned precision : {0U, 1U, 2U, 3U}) {
    const XsensSample sample = only_sample(message(item(0x4020 | precision, vector_in(precision)) +
                                                   item(0x8020 | precision, vector_in(precision)) +
                                                   item(0x2030 | precision, vector_in(precision))));
    EXPECT_TRUE(sample.has_acceleration && sample.has_rate && sample.has_euler);
    EXPECT_THAT(sample.acceleration_mps2, testing::ElementsAre(1.5, -2.25, 0.5)) << precision;
    EXPECT_THAT(sample.rate_radps, testing::ElementsAre(1.5, -2.25, 0.5)) << precision;
    EXPECT_THAT(sample.euler_deg, testing::ElementsAre(1.5, -2.25, 0.5)) << precision;
  }
}

TEST(Mtdata2, what_only_some_devices_send_is_read_in_each_precision_too) {
  const Bytes utc = big_endian(500'000'000, 4) + big_endian(2026, 2) + Bytes{11, 22, 8, 4, 16, 7};
  for (const unsigned precision : {0U, 1U, 2U, 3U}) {
    const Bytes vector = vector_in(precision);
    const Bytes scalar(vector.begin(), vector.begin() + static_cast<long>(vector.size() / 3));
    Bytes content = item(0x1010, utc) + item(0x3010, big_endian(101'325, 4));
    for (const unsigned id : {0x4010U, 0x4030U, 0x4040U, 0x8040U, 0xC020U, 0xD010U, 0x5030U})
      content = content + item(id | precision, vector);
    content = content + item(0x8030 | precision, vector + scalar) +
              item(0x5040 | precision, Bytes(vector.begin(), vector.begin() + static_cast<long>(2 * scalar.size()))) +
              item(0x0810 | precision, scalar) + item(0x5020 | precision, scalar) +
              item(0x2020 | precision, vector + vector + vector);
    const XsensSample sample = only_sample(message(content));
    for (const auto& read : {sample.delta_v_mps, sample.free_acceleration_mps2, sample.acceleration_hr_mps2,
                             sample.rate_hr_radps, sample.magnetic_field, sample.velocity_mps, sample.ecef_m})
      EXPECT_THAT(read.value(), testing::ElementsAre(1.5, -2.25, 0.5)) << precision;
    EXPECT_THAT(sample.delta_q.value(), testing::ElementsAre(1.5, -2.25, 0.5, 1.5));
    EXPECT_THAT(sample.latitude_longitude_deg.value(), testing::ElementsAre(1.5, -2.25));
    EXPECT_EQ(sample.temperature_c.value()[0], 1.5);
    EXPECT_EQ(sample.altitude_m.value()[0], 1.5);
    EXPECT_EQ(sample.pressure_pa, 101'325U);
    EXPECT_TRUE(sample.has_matrix);
    EXPECT_EQ(sample.matrix[4], -2.25);
    EXPECT_EQ(sample.utc->year, 2026);
    EXPECT_EQ(sample.utc->second, 16);
    EXPECT_EQ(sample.utc->nanosecond, 500'000'000U);
  }
}

TEST(Mtdata2, times_counter_and_status_are_read) {
  const XsensSample sample = only_sample(
      message(item(0x1020, big_endian(0xABCD, 2)) + item(0x1060, big_endian(0x12345678, 4)) +
              item(0x1070, big_endian(7, 4)) + item(0xE020, big_endian(0x01800007, 4)) + item(0xE010, {0x07})));
  EXPECT_TRUE(sample.has_packet_counter && sample.has_time_fine && sample.has_time_coarse && sample.has_status);
  EXPECT_EQ(sample.packet_counter, 0xABCD);
  EXPECT_EQ(sample.time_fine, 0x12345678U);
  EXPECT_EQ(sample.time_coarse_s, 7U);
  EXPECT_EQ(sample.status, 0x01800007U) << "the word says more than the byte";
}

TEST(Mtdata2, the_frame_of_an_orientation_is_in_its_id) {
  const Bytes q = big_endian(0x3F800000, 4) + Bytes(12);
  EXPECT_EQ(only_sample(message(item(0x2010, q))).frame, XsensFrame::east_north_up);
  EXPECT_EQ(only_sample(message(item(0x2014, q))).frame, XsensFrame::north_east_down);
  EXPECT_EQ(only_sample(message(item(0x2018, q))).frame, XsensFrame::north_west_up);
  EXPECT_THAT(only_sample(message(item(0x2018, q))).quaternion, testing::ElementsAre(1, 0, 0, 0));
}

TEST(Mtdata2, unknown_items_are_passed_over_by_their_size) {
  const XsensSample sample =
      only_sample(message(item(0x7010, Bytes(94)) + item(0x7020, {}) + item(0x8020, vector_in(0))));
  EXPECT_TRUE(sample.has_rate);
  EXPECT_FALSE(sample.has_acceleration);
}

TEST(Mtdata2, items_of_the_wrong_size_or_beyond_the_end_are_counted_and_not_believed) {
  Mtdata2Parser parser;
  const auto samples = samples_of(parser, message(item(0x4020, Bytes(11)) + item(0x201C, Bytes(16)) +
                                                  item(0x8020, vector_in(0)) + Bytes{0x40, 0x20, 0x0C, 0x01}));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_FALSE(samples[0].has_acceleration);
  EXPECT_FALSE(samples[0].has_quaternion);
  EXPECT_TRUE(samples[0].has_rate);
  EXPECT_EQ(parser.counters().malformed_item_count, 3U);
}

TEST(Mtdata2, messages_with_extended_length_are_read) {
  Bytes content;
  for (int i = 0; i < 9; ++i) content = content + item(0x7010, Bytes(200));
  const XsensSample sample = only_sample(message(content + item(0x1020, {0, 9})));
  EXPECT_EQ(sample.packet_counter, 9);
}

TEST(Mtdata2, a_stream_may_be_cut_anywhere) {
  const Bytes stream = counted(1) + message(item(0x8020, vector_in(3)) + item(0x7010, Bytes(250))) + counted(3);
  for (std::size_t piece = 1; piece < 20; ++piece) {
    Mtdata2Parser parser;
    std::size_t count = 0;
    for (std::size_t i = 0; i < stream.size(); i += piece) {
      count += samples_of(parser, std::span(stream).subspan(i, std::min(piece, stream.size() - i))).size();
    }
    EXPECT_EQ(count, 3U) << piece;
    EXPECT_EQ(parser.counters().skipped_byte_count, 0U);
  }
}

TEST(Mtdata2, after_a_damaged_length_no_good_message_is_lost) {
  Bytes damaged = counted(1);
  damaged[3] = 20;  // reaches into the messages behind it
  Mtdata2Parser parser;
  const auto samples = samples_of(parser, Bytes{0x00, 0xFA, 0xFA} + damaged + counted(2) + counted(3) + counted(4));
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_EQ(samples[0].packet_counter, 2);
  EXPECT_EQ(parser.counters().bad_checksum_count, 1U);
  EXPECT_EQ(parser.counters().skipped_byte_count, 3U + damaged.size());
}

TEST(Mtdata2, a_length_that_no_message_has_is_noise) {
  Mtdata2Parser parser;
  EXPECT_EQ(samples_of(parser, Bytes{0xFA, 0xFF, 0x36, 0xFF, 0x08, 0x01} + counted(5)).size(), 1U);
  EXPECT_EQ(parser.counters().skipped_byte_count, 6U);
}

TEST(Mtdata2, other_messages_and_device_errors_are_counted) {
  Mtdata2Parser parser;
  EXPECT_EQ(samples_of(parser, message({1}, 0x3E) + message({0x28}, 0x42) + counted(1)).size(), 1U);
  EXPECT_EQ(parser.counters().other_message_count, 2U);
  EXPECT_EQ(parser.counters().device_error_count, 1U);
  EXPECT_EQ(parser.counters().message_count, 1U);
}

TEST(Mtdata2, messages_missing_in_the_counter_are_counted_across_its_wrap_but_not_when_the_device_starts_anew) {
  Mtdata2Parser parser;
  const Bytes stream = counted(65534) + counted(65535) + counted(2) + counted(3) + counted(30000) + counted(30001);
  EXPECT_EQ(samples_of(parser, stream).size(), 6U);
  EXPECT_EQ(parser.counters().lost_message_count, 2U);
}

TEST(Mtdata2, noise_between_messages_costs_none_of_them) {
  std::mt19937 random(3);
  Bytes stream;
  for (std::uint16_t i = 0; i < 200; ++i) {
    Bytes noise(random() % 40);
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random() % 255);  // no 0xFF: no false start
    stream = stream + noise + counted(i);
  }
  Mtdata2Parser parser;
  EXPECT_EQ(samples_of(parser, stream).size(), 200U);
}

/// What the reference says of one message: "Acceleration" -> its numbers, or "StatusWord" -> its digits.
using Golden = std::map<std::string, std::vector<std::string>>;

std::vector<Golden> goldens_of(const std::string& path) {
  std::ifstream stream(path);
  std::vector<Golden> messages(1);
  std::string line;
  std::string key;
  while (std::getline(stream, line)) {
    if (line.empty()) {
      messages.emplace_back();
    } else if (line.front() != ' ') {
      key = line.substr(0, line.find_first_of("(:"));
      messages.back()[key] = {};
    } else {
      // "  X:1.5" or "  43398"
      const std::size_t colon = line.find(':');
      messages.back()[key].push_back(colon == std::string::npos ? line.substr(2) : line.substr(colon + 1));
    }
  }
  while (!messages.empty() && messages.back().empty()) messages.pop_back();
  return messages;
}

void expect_vector(const Golden& golden, const std::string& key, bool has, const std::array<double, 3>& vector) {
  ASSERT_EQ(has, golden.contains(key));
  if (!has) return;
  const std::vector<std::string>& expected = golden.at(key);
  ASSERT_EQ(expected.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    double value = 0.0;
    std::from_chars(expected[i].data(), expected[i].data() + expected[i].size(), value);
    EXPECT_EQ(vector[i], value) << key;
  }
}

void expect_message(const Golden& golden, const XsensSample& sample) {
  EXPECT_EQ(std::to_string(sample.packet_counter), golden.at("PacketCounter").at(0));
  EXPECT_EQ(std::to_string(sample.time_fine), golden.at("SampleTimeFine").at(0));
  const bool has_word = golden.contains("StatusWord");
  ASSERT_EQ(sample.has_status, has_word || golden.contains("StatusByte"));
  if (sample.has_status) {
    EXPECT_EQ(sample.status, std::stoul(golden.at(has_word ? "StatusWord" : "StatusByte").at(0), nullptr, 2));
  }
  expect_vector(golden, "Acceleration", sample.has_acceleration, sample.acceleration_mps2);
  expect_vector(golden, "RateOfTurn", sample.has_rate, sample.rate_radps);
  expect_vector(golden, "EulerAngles", sample.has_euler, sample.euler_deg);
}

TEST(Mtdata2Recordings, four_recordings_in_four_precisions_give_their_reference_values_exactly) {
  for (const char* name : {"xsens_1", "xsens_2", "xsens_3", "xsens_4"}) {
    const auto folder = recording(std::string("imu/") + name);
    if (!folder) return;
    SCOPED_TRACE(name);
    std::ifstream stream(*folder + "/output.bin", std::ios::binary);
    const std::vector<char> raw((std::istreambuf_iterator<char>(stream)), {});
    const Bytes bytes(raw.begin(), raw.end());
    const std::vector<Golden> goldens = goldens_of(*folder + "/output.golden");
    Mtdata2Parser parser;
    const std::vector<XsensSample> samples = samples_of(parser, bytes);
    ASSERT_EQ(samples.size(), 100U);
    ASSERT_EQ(goldens.size(), samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) expect_message(goldens[i], samples[i]);
    EXPECT_EQ(parser.counters().skipped_byte_count, 0U);
    EXPECT_EQ(parser.counters().malformed_item_count, 0U);
    EXPECT_EQ(parser.counters().lost_message_count, 0U);
  }
}

}  // namespace
}  // namespace roadvec
