#include "drivers/imu/ncom.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "core/base/angle.h"

namespace roadvec {
namespace {

using Packet = std::array<std::uint8_t, kNcomPacketBytes>;

void put(Packet& packet, std::size_t at, std::int64_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) packet[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

void seal(Packet& packet) {
  unsigned sum = 0;
  for (std::size_t i = 1; i < 71; ++i) sum += packet[i];
  packet[71] = static_cast<std::uint8_t>(sum);
}

/// A car that drives north-east, level, and turns right with 0.1 rad/s.
Packet packet_at(std::uint16_t time_ms, std::optional<std::int32_t> minutes = std::nullopt) {
  Packet packet{};
  packet[0] = 0xE7;
  put(packet, 1, time_ms, 2);
  put(packet, 3, 5'000, 3), put(packet, 6, -2'000, 3), put(packet, 9, -98'100, 3);
  put(packet, 12, 100, 3), put(packet, 15, -200, 3), put(packet, 18, 10'000, 3);
  packet[21] = 4;
  put(packet, 52, 785'398, 3), put(packet, 55, 20'000, 3), put(packet, 58, -30'000, 3);
  packet[62] = minutes ? 0 : 1;
  if (minutes) put(packet, 63, *minutes, 4);
  seal(packet);
  return packet;
}

struct Decoded {
  explicit Decoded(const Mounting& mounting = {}) : decoder(mounting) {}
  void add(const std::vector<std::uint8_t>& stream, std::optional<SensorTime> time = std::nullopt) {
    ImuBytes bytes{time.value_or(SensorTime{}), time.has_value(), stream};
    MotionSample sample;
    while (decoder.next(bytes, sample)) samples.push_back(sample);
    EXPECT_TRUE(bytes.bytes.empty());
  }
  void add(const Packet& packet, std::optional<SensorTime> time = std::nullopt) {
    add(std::vector<std::uint8_t>(packet.begin(), packet.end()), time);
  }
  [[nodiscard]] const ImuSample& last() const { return std::get<ImuSample>(samples.back().value); }
  NcomDecoder decoder;
  std::vector<MotionSample> samples;
};

constexpr std::int32_t kMinutes = 24'000'000;  // 2025-08-24 16:00:00 GPS
constexpr std::int64_t kMinutes_utc_ns = (315'964'800LL + kMinutes * 60LL - 18) * 1'000'000'000;

TEST(Ncom, motion_is_turned_to_x_ahead_y_left_z_up_and_heading_from_east) {
  Decoded decoded;
  decoded.add(packet_at(0), SensorTime{77});
  ASSERT_EQ(decoded.samples.size(), 1U);
  EXPECT_EQ(decoded.samples[0].time.ns, 77);
  const ImuSample& imu = decoded.last();
  EXPECT_NEAR(imu.acceleration_x_mps2, 0.5, 1e-9);
  EXPECT_NEAR(imu.acceleration_y_mps2, 0.2, 1e-9);
  EXPECT_NEAR(imu.acceleration_z_mps2, 9.81, 1e-9);
  EXPECT_NEAR(imu.rate_x_radps, 0.001, 1e-9);
  EXPECT_NEAR(imu.rate_y_radps, 0.002, 1e-9);
  EXPECT_NEAR(imu.rate_z_radps, -0.1, 1e-9) << "right is down";
  EXPECT_NEAR(imu.heading_rad, kPi / 2 - 0.785398, 1e-9);
  EXPECT_NEAR(imu.roll_rad, -0.03, 1e-9);
  EXPECT_NEAR(imu.pitch_rad, -0.02, 1e-9) << "nose up is negative about y left";
}

TEST(Ncom, a_mounting_is_undone) {
  Decoded decoded({.yaw_rad = kPi / 2});  // the unit's x axis points to the vehicle's left
  decoded.add(packet_at(0), SensorTime{});
  EXPECT_NEAR(decoded.last().rate_x_radps, -0.002, 1e-9);
  EXPECT_NEAR(decoded.last().rate_y_radps, 0.001, 1e-9);
  EXPECT_NEAR(decoded.last().heading_rad, -0.785398, 1e-3);  // roll and pitch are not quite level
}

TEST(Ncom, a_value_that_is_not_there_is_not_handed_on) {
  Packet packet = packet_at(0);
  put(packet, 15, 0x800000, 3);
  put(packet, 58, 0x800000, 3);
  seal(packet);
  Decoded decoded;
  decoded.add(packet, SensorTime{});
  ASSERT_EQ(decoded.samples.size(), 1U);
  EXPECT_FALSE(decoded.last().has_rate);
  EXPECT_FALSE(decoded.last().has_orientation);
  EXPECT_TRUE(decoded.last().has_acceleration);
}

TEST(Ncom, a_unit_that_does_not_navigate_gives_rates_and_no_angles_or_nothing) {
  Decoded decoded;
  for (const int status : {0, 1, 2, 3}) {
    Packet packet = packet_at(0);
    packet[21] = static_cast<std::uint8_t>(status);
    seal(packet);
    decoded.add(packet, SensorTime{});
  }
  ASSERT_EQ(decoded.samples.size(), 3U);
  EXPECT_EQ(decoded.decoder.counters().not_ready_count, 1U);
  EXPECT_FALSE(std::get<ImuSample>(decoded.samples[1].value).has_orientation);
  EXPECT_TRUE(std::get<ImuSample>(decoded.samples[2].value).has_orientation);
}

TEST(Ncom, trigger_and_status_packets_hold_no_motion_and_do_not_disturb_the_clock) {
  Decoded decoded;
  decoded.add(packet_at(1000, kMinutes));
  for (const int status : {10, 20, 21, 22}) {
    Packet packet = packet_at(40'000);
    packet[21] = static_cast<std::uint8_t>(status);
    seal(packet);
    decoded.add(packet);
  }
  decoded.add(packet_at(1010));
  ASSERT_EQ(decoded.samples.size(), 2U);
  EXPECT_EQ(decoded.samples[1].time - decoded.samples[0].time, 10'000'000);
  EXPECT_EQ(decoded.decoder.counters().trigger_count, 4U);
}

TEST(Ncom, without_a_reader_that_knows_the_time_it_is_the_units_own_as_utc) {
  Decoded decoded;
  decoded.add(packet_at(59'980));
  EXPECT_TRUE(decoded.samples.empty()) << "the minute is not known yet";
  EXPECT_EQ(decoded.decoder.untimed_count(), 1U);
  decoded.add(packet_at(59'990, kMinutes));
  for (const int time_ms : {0, 10, 20}) decoded.add(packet_at(static_cast<std::uint16_t>(time_ms)));
  ASSERT_EQ(decoded.samples.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(decoded.samples[i].time.ns, kMinutes_utc_ns + 59'990'000'000 + static_cast<std::int64_t>(i) * 10'000'000);
}

TEST(Ncom, minutes_that_cannot_be_are_not_believed) {
  Decoded decoded;
  for (const std::int32_t minutes : {0, -1, 1'795'162'112, 100'000'000}) decoded.add(packet_at(0, minutes));
  EXPECT_TRUE(decoded.samples.empty());
  EXPECT_EQ(decoded.decoder.untimed_count(), 4U);
}

TEST(Ncom, packets_out_of_order_around_the_full_minute_keep_their_minutes) {
  Decoded decoded;
  decoded.add(packet_at(59'990, kMinutes));
  decoded.add(packet_at(10));
  decoded.add(packet_at(59'999));
  decoded.add(packet_at(20));
  ASSERT_EQ(decoded.samples.size(), 4U);
  EXPECT_EQ(decoded.samples[2].time.ns, kMinutes_utc_ns + 59'999'000'000);
  EXPECT_EQ(decoded.samples[3].time.ns, kMinutes_utc_ns + 60'020'000'000);
}

TEST(Ncom, utc_lags_gps_by_the_leap_seconds_of_its_time) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  const auto utc_s = [](std::int64_t gps_s) { return utc_from_gps_ns(gps_s * kSecond_ns).ns / kSecond_ns; };
  EXPECT_EQ(utc_s(0), 315'964'800);
  EXPECT_EQ(utc_s(1'167'264'018), 1'483'228'800);  // 2017-01-01 00:00:00
  EXPECT_EQ(utc_s(1'167'264'016), 1'483'228'799);  // one second of UTC is 17 before, and then comes the leap
  EXPECT_EQ(utc_s(1'025'136'016), 1'341'100'800);  // 2012-07-01
}

TEST(Ncom, packets_are_found_in_pieces_in_noise_and_behind_damage) {
  std::mt19937 random(5);
  std::vector<std::uint8_t> stream;
  const auto noise = [&](int count) {
    for (int i = 0; i < count; ++i) stream.push_back(static_cast<std::uint8_t>(random()));
  };
  const auto add = [&](Packet packet, bool damaged = false) {
    if (damaged) packet[30] = static_cast<std::uint8_t>(packet[30] + 1);
    stream.insert(stream.end(), packet.begin(), packet.end());
  };
  noise(100);
  stream.push_back(0xE7);  // a sync byte that begins nothing
  add(packet_at(10));
  add(packet_at(20), true);
  add(packet_at(30));
  noise(50);
  add(packet_at(40));
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, stream.size()}) {
    Decoded decoded;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      const auto end = std::min(stream.size(), at + piece);
      decoded.add(
          std::vector<std::uint8_t>(stream.begin() + static_cast<long>(at), stream.begin() + static_cast<long>(end)),
          SensorTime{static_cast<std::int64_t>(end)});
    }
    EXPECT_EQ(decoded.samples.size(), 3U) << piece;
    EXPECT_EQ(decoded.decoder.counters().packet_count, 3U);
    EXPECT_GE(decoded.decoder.counters().bad_checksum_count, 2U);
    EXPECT_EQ(decoded.decoder.counters().skipped_byte_count, stream.size() - 3 * kNcomPacketBytes);
  }
}

}  // namespace
}  // namespace roadvec
