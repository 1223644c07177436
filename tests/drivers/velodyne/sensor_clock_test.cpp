#include "drivers/velodyne/sensor_clock.h"

#include <gtest/gtest.h>

#include <string>

#include "drivers/velodyne/pcap_reader.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

constexpr const char* kFix = "$GPRMC,220632,A,3707.8324,N,12139.2864,W,000.0,144.7,111212,013.8,E,D*09\r\n";
constexpr const char* kNextFix = "$GPRMC,220633,A,3707.8324,N,12139.2864,W,000.0,144.7,111212,013.8,E,D*08\r\n";
constexpr const char* kNoFix = "$GPRMC,220633,V,3707.8324,N,12139.2864,W,000.0,144.7,111212,013.8,E,D*1F\r\n";
constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kFixTime_ns = 1'355'263'592 * kSecond_ns;  // 2012-12-11 22:06:32 UTC

RawPositionPacket packet(const std::string& nmea, std::uint32_t device_us = 393'200'000, std::uint8_t pps = 2) {
  RawPositionPacket raw;
  raw.arrived = {kFixTime_ns + 1'210'000'000};
  for (std::size_t i = 0; i < 4; ++i) raw.bytes[198 + i] = static_cast<std::uint8_t>(device_us >> (8 * i));
  raw.bytes[202] = pps;
  for (std::size_t i = 0; i < nmea.size() && 206 + i < raw.bytes.size(); ++i)
    raw.bytes[206 + i] = static_cast<std::uint8_t>(nmea[i]);
  return raw;
}

void put_word(RawPositionPacket& raw, std::size_t at, unsigned value) {
  raw.bytes[at] = static_cast<std::uint8_t>(value);
  raw.bytes[at + 1] = static_cast<std::uint8_t>(value >> 8);
}

TEST(PositionPacket, time_pulse_and_sentence_are_read_in_both_layouts) {
  const RawPositionPacket raw = packet(kFix);
  const PositionPacket read = parse_position_packet(raw);
  EXPECT_EQ(read.device_time_us, 393'200'000U);
  EXPECT_EQ(read.pps, PpsState::locked);
  EXPECT_EQ(read.nmea, kFix);
  EXPECT_FALSE(read.temperature_c);
}

TEST(PositionPacket, a_pulse_byte_outside_its_states_is_unknown) {
  for (const int byte : {4, 0x95, 0xD2, 0xFF})
    EXPECT_EQ(parse_position_packet(packet(kFix, 0, static_cast<std::uint8_t>(byte))).pps, PpsState::unknown);
  EXPECT_EQ(parse_position_packet(packet(kFix, 0, 0)).pps, PpsState::absent);
  EXPECT_EQ(parse_position_packet(packet(kFix, 0, 3)).pps, PpsState::error);
}

TEST(PositionPacket, the_old_layout_tells_the_temperature_of_its_inertial_unit) {
  RawPositionPacket raw = packet(kFix, 0, 0xD2);
  for (const std::size_t group : {14U, 22U, 30U}) {
    for (unsigned kind = 0; kind < 4; ++kind) put_word(raw, group + 2 * kind, kind << 12 | 100);
  }
  EXPECT_NEAR(parse_position_packet(raw).temperature_c.value(), 25 + 14.53, 1e-9);
  put_word(raw, 16, 0x1FFF);
  EXPECT_NEAR(parse_position_packet(raw).temperature_c.value(), 25 - 0.1453, 1e-9);
}

TEST(PositionPacket, the_new_layout_tells_the_temperature_of_its_boards_and_a_shutdown) {
  RawPositionPacket raw = packet(kFix);
  raw.bytes[0xBB] = 41;
  EXPECT_EQ(parse_position_packet(raw).temperature_c, 41.0);
  EXPECT_FALSE(parse_position_packet(raw).thermal_shutdown);
  raw.bytes[0xCB] = 1;
  EXPECT_TRUE(parse_position_packet(raw).thermal_shutdown);
  raw.bytes[0xCA] = 0x95;  // junk of old firmware
  EXPECT_FALSE(parse_position_packet(raw).temperature_c);
}

TEST(PositionPacket, a_sentence_that_fills_the_packet_ends_with_it) {
  EXPECT_EQ(parse_position_packet(packet(std::string(400, 'x'))).nmea.size(), 306U);
}

TEST(SensorClock, tells_each_sentence_once_although_the_sensor_repeats_it) {
  SensorClock clock;
  EXPECT_EQ(clock.add(packet("")), nullptr);
  ASSERT_NE(clock.add(packet(kFix)), nullptr);
  EXPECT_EQ(clock.add(packet(kFix)), nullptr);
  EXPECT_NE(clock.add(packet(kNextFix)), nullptr);
  EXPECT_NE(clock.add(packet(kNoFix)), nullptr) << "losing the fix is news";
  EXPECT_EQ(clock.report().position_packet_count, 5U);
  EXPECT_EQ(clock.report().nmea_count, 4U);
  EXPECT_FALSE(clock.report().fix->valid);
}

TEST(SensorClock, measures_how_late_sensor_and_host_are_after_the_sentence) {
  SensorClock clock;
  clock.add(packet(kFix));
  EXPECT_EQ(clock.report().device_after_nmea_ns, 1'200'000'000);  // 6:33.2 past the hour, the sentence tells of 6:32
  EXPECT_EQ(clock.report().host_after_nmea_ns, 1'210'000'000);
  EXPECT_EQ(keeps_utc(clock.report()), true);
}

TEST(SensorClock, a_sensor_that_counts_from_its_own_start_does_not_keep_utc) {
  SensorClock clock;
  EXPECT_EQ(keeps_utc(clock.report()), std::nullopt);
  clock.add(packet(kFix, 17'000'000));
  EXPECT_EQ(keeps_utc(clock.report()), false);
  clock.add(packet(kNoFix));
  EXPECT_EQ(keeps_utc(clock.report()), std::nullopt) << "without a fix the receiver's time is worth nothing";
}

TEST(SensorClock, agrees_across_the_hour) {
  SensorClock clock;
  clock.add(packet("$GPRMC,215959,A,3707.8324,N,12139.2864,W,000.0,144.7,111212,013.8,E,D*0D\r\n", 200'000));
  EXPECT_EQ(clock.report().device_after_nmea_ns, 1'200'000'000);
}

TEST(SensorClock, counts_bad_sentences_and_reads_several_of_one_packet) {
  SensorClock clock;
  std::string damaged = kFix;
  damaged[20] = '#';
  clock.add(packet(damaged + "$GPGSV,3,1,11*7B\r\n" + kNextFix));
  EXPECT_EQ(clock.report().nmea_bad_count, 1U);
  EXPECT_EQ(clock.report().nmea_count, 1U);
  EXPECT_EQ(clock.report().fix->time_of_day_ns, ((22 * 60 + 6) * 60 + 33) * kSecond_ns);
}

TEST(SensorClock, reads_the_receiver_of_a_real_hdl32e) {
  const auto path = recording("velodyne/hdl32e_monterey.pcap");
  if (!path) return;
  LidarCounters counters;
  auto reader = PcapReader::open(*path, {}, counters);
  ASSERT_TRUE(reader);
  SensorClock clock;
  std::span<const RawPacket> batch;
  int news_count = 0;
  while ((*reader)->read(batch, {}) == ReadResult::packets) {
    for (const RawPositionPacket& position : (*reader)->positions()) news_count += clock.add(position) != nullptr;
  }
  EXPECT_EQ(clock.report().position_packet_count, 299U);
  EXPECT_EQ(counters.position_packets.value(), 299U);
  EXPECT_EQ(clock.report().nmea_bad_count, 0U);
  EXPECT_EQ(news_count, 2);
  EXPECT_EQ(keeps_utc(clock.report()), true);
  EXPECT_NEAR(clock.report().temperature_c.value(), 40, 25);
}

}  // namespace
}  // namespace roadvec
