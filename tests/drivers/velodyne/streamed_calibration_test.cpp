#include "drivers/velodyne/streamed_calibration.h"

#include <gmock/gmock.h>

#include <fstream>
#include <random>
#include <sstream>
#include <utility>

#include "drivers/velodyne/hdl64_status.h"
#include "drivers/velodyne/pcap_reader.h"
#include "tests/drivers/velodyne/packets.h"
#include "tests/drivers/velodyne/streamed_table.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

void feed(StreamedCalibration& table, StreamedTable& head, unsigned packet_count) {
  for (unsigned i = 0; i < packet_count; ++i) {
    const StreamedTable::Packet packet = head.next();
    table.add(packet.type, packet.value, 0);
  }
}

void expect_made_up_table(const Calibration& calibration) {
  ASSERT_EQ(calibration.lasers.size(), 64U);
  for (int n = 0; n < 64; ++n) {
    const LaserCalibration& laser = calibration.lasers[static_cast<std::size_t>(n)];
    EXPECT_NEAR(laser.elevation_rad, rad_from_deg(-0.25 * n), 1e-12);
    EXPECT_NEAR(laser.rotation_rad, rad_from_deg(0.1 * (n - 32)), 1e-12);
    EXPECT_NEAR(laser.distance_m, 1.200 + 0.001 * n, 1e-12);
    EXPECT_NEAR(laser.distance_x_m, 1.210 + 0.001 * n, 1e-12);
    EXPECT_NEAR(laser.distance_y_m, 1.220 + 0.001 * n, 1e-12);
    EXPECT_NEAR(laser.vertical_offset_m, 0.200, 1e-12);
    EXPECT_NEAR(laser.horizontal_offset_m, 0.026, 1e-12);
    EXPECT_NEAR(laser.focal_distance_m, 12.0, 1e-12);
    EXPECT_NEAR(laser.focal_slope, 1.1, 1e-12);
    EXPECT_EQ(laser.min_intensity, 10);
    EXPECT_EQ(laser.max_intensity, 250);
  }
}

TEST(StreamedCalibration, of_an_s3_is_complete_after_one_round_wherever_it_begins) {
  for (const unsigned begin : {0U, 1U, 9U, 700U, 4151U}) {
    StreamedTable head(true);
    head.skip(begin);
    StreamedCalibration table;
    feed(table, head, StreamedTable::kPackets - 32);
    EXPECT_FALSE(table.complete());
    feed(table, head, 64);
    ASSERT_TRUE(table.complete()) << begin;
    expect_made_up_table(table.calibration());
    EXPECT_EQ(table.returns(), StreamedCalibration::Returns::both);
  }
}

TEST(StreamedCalibration, of_an_s2_is_believed_when_it_came_twice_alike) {
  StreamedTable head(false);
  StreamedCalibration table;
  feed(table, head, StreamedTable::kPackets + 16);
  EXPECT_FALSE(table.complete());
  feed(table, head, StreamedTable::kPackets + 65 * 16);
  ASSERT_TRUE(table.complete());
  expect_made_up_table(table.calibration());
}

TEST(StreamedCalibration, costs_another_round_when_one_packet_is_lost) {
  for (const bool s3 : {false, true}) {
    StreamedTable head(s3);
    StreamedCalibration table;
    feed(table, head, 1'000);
    head.skip(1);
    StreamedTable::Packet packet = head.next();
    table.add(packet.type, packet.value, 1);
    feed(table, head, 3 * StreamedTable::kPackets);
    ASSERT_TRUE(table.complete());
    expect_made_up_table(table.calibration());
  }
}

TEST(StreamedCalibration, finds_its_place_again_though_the_count_of_lost_packets_is_a_little_wrong) {
  for (const int error : {-7, -3, 2, 7}) {
    StreamedTable head(true);
    StreamedCalibration table;
    feed(table, head, 2'003);
    head.skip(5'000);
    const StreamedTable::Packet packet = head.next();
    table.add(packet.type, packet.value, static_cast<std::uint32_t>(5'000 + error));
    feed(table, head, StreamedTable::kPackets + 65 * 16);
    ASSERT_TRUE(table.complete()) << error;
    EXPECT_EQ(table.refused_count(), 0U) << error;
    expect_made_up_table(table.calibration());
  }
}

TEST(StreamedCalibration, recovers_when_the_count_of_lost_packets_is_nonsense) {
  StreamedTable head(true);
  StreamedCalibration table;
  feed(table, head, 2'000);
  head.skip(300);
  const StreamedTable::Packet packet = head.next();
  table.add(packet.type, packet.value, 4'000'000'000U);
  feed(table, head, 3 * StreamedTable::kPackets);
  ASSERT_TRUE(table.complete());
  expect_made_up_table(table.calibration());
}

TEST(StreamedCalibration, survives_losing_seven_packets_of_ten) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    StreamedTable head(true);
    StreamedCalibration table;
    std::minstd_rand random(seed);
    std::uint32_t lost_count = 0;
    for (unsigned i = 0; i < 40 * StreamedTable::kPackets; ++i) {
      const StreamedTable::Packet packet = head.next();
      if (random() % 10 < 7) {
        ++lost_count;
      } else {
        table.add(packet.type, packet.value, std::exchange(lost_count, 0));
      }
    }
    ASSERT_TRUE(table.complete()) << "seed " << seed;
    expect_made_up_table(table.calibration());
  }
}

TEST(StreamedCalibration, with_a_wrong_crc_is_refused_until_the_damaged_byte_is_outvoted) {
  StreamedTable head(true);
  StreamedCalibration table;
  std::uint8_t& byte = head.bytes[StreamedTable::laser_byte(20) + 6];
  byte ^= 0x40;
  feed(table, head, StreamedTable::kPackets);
  EXPECT_FALSE(table.complete());
  EXPECT_EQ(table.refused_count(), 1U);
  byte ^= 0x40;
  feed(table, head, StreamedTable::kPackets + 65 * 16);
  ASSERT_TRUE(table.complete());
  expect_made_up_table(table.calibration());
}

TEST(StreamedCalibration, that_is_always_wrong_is_never_taken) {
  StreamedTable wrong_crc(true), wrong_length(false), implausible(true);
  wrong_crc.bytes[StreamedTable::laser_byte(3) + 5] ^= 1;
  wrong_length.bytes[StreamedTable::kBytes - 2] ^= 1;
  implausible.bytes[StreamedTable::laser_byte(3) + 2] = 0x7F;  // elevation 326 degrees
  implausible.put_trailer();
  for (StreamedTable* head : {&wrong_crc, &wrong_length, &implausible}) {
    StreamedCalibration table;
    feed(table, *head, 4 * StreamedTable::kPackets);
    EXPECT_FALSE(table.complete());
    EXPECT_GT(table.refused_count(), 0U);
  }
}

TEST(StreamedCalibration, leaves_intensity_alone_where_the_head_corrects_it_itself) {
  StreamedTable head(true, 0xA8);
  StreamedCalibration table;
  feed(table, head, StreamedTable::kPackets + 16);
  ASSERT_TRUE(table.complete());
  const LaserCalibration& laser = table.calibration().lasers[7];
  EXPECT_EQ(laser.focal_slope, 0);
  EXPECT_EQ(laser.min_intensity, 0);
  EXPECT_EQ(laser.max_intensity, 255);
  EXPECT_NEAR(laser.distance_m, 1.207, 1e-12);
}

TEST(StreamedCalibration, ignores_types_it_does_not_know_but_counts_their_packets) {
  StreamedTable head(true);
  StreamedCalibration table;
  for (unsigned i = 0; i < 2 * StreamedTable::kPackets + 65 * 16; ++i) {
    const StreamedTable::Packet packet = head.next();
    table.add(i % 100 == 50 ? 0xFB : packet.type, packet.value, 0);
  }
  ASSERT_TRUE(table.complete());
  expect_made_up_table(table.calibration());
}

TEST(Hdl64Status, keeps_what_the_head_says_of_time_and_health) {
  StreamedTable head(true);
  Hdl64Status status;
  EXPECT_FALSE(status.hour.has_value());
  for (int i = 0; i < 16 * 5; ++i) {
    const StreamedTable::Packet packet = head.next();
    status.add(packet.type, packet.value, 0);
  }
  EXPECT_EQ(status.hour, 7);
  EXPECT_EQ(status.temperature_degc, 7);
  EXPECT_TRUE(status.follows_gps());
  EXPECT_EQ(status.warnings, 0);
  EXPECT_FALSE(status.table().complete());
}

/// A whole driver waits for the table, counts what it puts off, and then decodes as if it had had it all along.
TEST(SweepDecoder, begins_when_the_streamed_calibration_is_complete) {
  for (const LidarModel model : {LidarModel::hdl64e_s2, LidarModel::hdl64e_s3}) {
    Bench bench(model, *calibration_for(model, kStreamedCalibration), {});
    FakeHead head(model);
    StreamedTable table(model == LidarModel::hdl64e_s3);
    std::size_t packet_count = 0;
    while (!bench.driver.calibrated() && packet_count < 3 * StreamedTable::kPackets) {
      RawPacket packet = head.next();
      const StreamedTable::Packet status = table.next();
      packet.bytes[kReturnModeOffset] = status.type;
      packet.bytes[kProductIdOffset] = status.value;
      bench.driver.add(packet);
      ++packet_count;
    }
    ASSERT_TRUE(bench.driver.calibrated());
    EXPECT_EQ(bench.counts().uncalibrated, packet_count);
    bench.driver.finish();
    EXPECT_TRUE(bench.sink.sweeps.empty());
    for (int i = 0; i < 10; ++i) bench.driver.add(head.next());
    bench.driver.finish();
    ASSERT_FALSE(bench.sink.sweeps.empty());
    std::size_t seen_count = 0;
    for (const Sweep& sweep : bench.sink.sweeps) {
      for (const Return& r : sweep.returns) {
        if (r.laser != 63) continue;
        ++seen_count;
        EXPECT_NEAR(r.z_m, (5 + 1.263) * std::sin(rad_from_deg(-0.25 * 63)) + 0.2, 0.02);
      }
    }
    EXPECT_EQ(seen_count, 60U);
  }
}

std::vector<RawPacket> packets_in(const std::string& path) {
  std::vector<RawPacket> packets;
  LidarCounters counters;
  auto reader = PcapReader::open(path, {}, counters);
  EXPECT_TRUE(reader.has_value());
  std::span<const RawPacket> batch;
  while (reader && (*reader)->read(batch, {}) == ReadResult::packets)
    packets.insert(packets.end(), batch.begin(), batch.end());
  return packets;
}

/// Lines of "id min max rotation vertical distance x y vertical-offset horizontal-offset focal-distance focal-slope".
std::vector<std::array<double, 12>> factory_table(const std::string& path) {
  std::vector<std::array<double, 12>> rows;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::array<double, 12> row{};
    for (double& value : row) words >> value;
    if (words) rows.push_back(row);
  }
  return rows;
}

int expect_factory_table(const std::string& pcap, const std::vector<std::array<double, 12>>& rows) {
  Bench bench(LidarModel::hdl64e_s3, Calibration{.streamed = true}, {});
  for (const RawPacket& packet : packets_in(pcap)) bench.driver.add(packet);
  int carried_count = 0;
  for (int n = 0; n < 64; ++n) {
    const auto maybe_laser = bench.driver.status().table().laser(n);
    if (!maybe_laser) continue;
    ++carried_count;
    const std::array<double, 12>& row = rows[static_cast<std::size_t>(n)];
    // The head sends hundredths of a degree, millimetres and tenths.
    EXPECT_EQ(maybe_laser->min_intensity, row[1]) << n;
    EXPECT_EQ(maybe_laser->max_intensity, row[2]) << n;
    EXPECT_NEAR(deg_from_rad(maybe_laser->rotation_rad), row[3], 0.0101) << n;
    EXPECT_NEAR(deg_from_rad(maybe_laser->elevation_rad), row[4], 0.0101) << n;
    EXPECT_NEAR(maybe_laser->distance_m * 100, row[5], 0.101) << n;
    EXPECT_NEAR(maybe_laser->distance_x_m * 100, row[6], 0.101) << n;
    EXPECT_NEAR(maybe_laser->distance_y_m * 100, row[7], 0.101) << n;
    EXPECT_NEAR(maybe_laser->vertical_offset_m * 100, row[8], 0.101) << n;
    EXPECT_NEAR(maybe_laser->horizontal_offset_m * 100, row[9], 0.101) << n;
    EXPECT_NEAR(maybe_laser->focal_distance_m * 100, row[10], 0.101) << n;
    EXPECT_NEAR(maybe_laser->focal_slope, row[11], 0.101) << n;
  }
  return carried_count;
}

TEST(StreamedCalibration, of_a_real_s3_equals_the_makers_table_for_every_laser_it_carries) {
  const auto maybe_factory = recording("velodyne/hdl64e_s3_xjtu_2016_calibration.txt");
  const auto maybe_six = recording("velodyne/hdl64e_s3_dual_6_revolutions.pcap");
  const auto maybe_lossy = recording("velodyne/hdl64e_s3_70pct_packet_loss.pcap");
  if (!maybe_factory || !maybe_six || !maybe_lossy) return;
  const auto rows = factory_table(*maybe_factory);
  ASSERT_EQ(rows.size(), 64U);
  // Six stretches of 586 packets hold eight or nine lasers each.
  EXPECT_GE(expect_factory_table(*maybe_six, rows), 30);
  // Losses leave next to no laser whole; what is whole is right.
  expect_factory_table(*maybe_lossy, rows);
}

TEST(SweepDecoder, reports_the_loss_of_a_real_capture) {
  const auto maybe_pcap = recording("velodyne/hdl64e_s3_70pct_packet_loss.pcap");
  if (!maybe_pcap) return;
  const std::vector<RawPacket> packets = packets_in(*maybe_pcap);
  Bench bench(LidarModel::hdl64e_s3);
  for (const RawPacket& packet : packets) bench.driver.add(packet);
  constexpr double kPeriod_us = 172.75;  // of this head, between packets that follow each other
  const double sent = 1 + (device_time_us(packets.back().bytes) - device_time_us(packets.front().bytes)) / kPeriod_us;
  const double lost_share = static_cast<double>(bench.counts().device_time_gaps) / sent;
  EXPECT_NEAR(lost_share, 1 - static_cast<double>(packets.size()) / sent, 0.02);
  EXPECT_GT(lost_share, 0.5);
  EXPECT_EQ(bench.counts().wrong_flags, 0U);
}

}  // namespace
}  // namespace roadvec
