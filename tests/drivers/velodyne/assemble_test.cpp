#include "drivers/velodyne/assemble.h"

#include <gmock/gmock.h>

#include <functional>

#include "tests/drivers/velodyne/packets.h"

namespace roadvec {
namespace {

// An HDL-64E that turns 0.18 degrees from reading to reading: 2000 readings in a revolution, 333.3 packets, 96 ms.
constexpr int kPacketsPerTurn = 334;
constexpr std::size_t kReturnsPerTurn = 2000 * 64;

struct Road : Bench {
  explicit Road(const SweepDecoderOptions& options = {}) : Bench(LidarModel::hdl64e_s2, options) {}
  /// `change` may alter a packet; false: it is lost.
  void drive(int packet_count, const std::function<bool(int, RawPacket&)>& change = nullptr) {
    for (int i = 0; i < packet_count; ++i) {
      RawPacket packet = head.next();
      if (!change || change(i, packet)) driver.add(packet);
    }
  }
  [[nodiscard]] std::vector<bool> complete() const {
    std::vector<bool> flags;
    for (const Sweep& sweep : sink.sweeps) flags.push_back(sweep.complete);
    return flags;
  }
  FakeHead head{LidarModel::hdl64e_s2};
};

TEST(SweepAssembler, cuts_behind_the_car_between_two_readings) {
  Road road;
  road.drive(3 * kPacketsPerTurn);
  road.driver.finish();
  EXPECT_THAT(road.complete(), testing::ElementsAre(false, true, true, false));
  for (std::size_t i = 1; i <= 2; ++i) {
    const Sweep& sweep = road.sink.sweeps[i];
    EXPECT_EQ(sweep.returns.size(), kReturnsPerTurn);
    EXPECT_EQ(sweep.index, i);
    EXPECT_NEAR(sweep.returns.front().azimuth_rad, kPi, 1e-6);
    EXPECT_LT(sweep.returns.back().azimuth_rad, kPi);
    EXPECT_EQ(sweep.returns.front().time_ns, 0U);
    EXPECT_EQ(sweep.end - sweep.start, 1999 * 48'000 + 45'660);
    EXPECT_EQ(sweep.returns.back().time_ns, sweep.end - sweep.start);
  }
  EXPECT_EQ(road.sink.sweeps[2].start - road.sink.sweeps[1].start, 2000 * 48'000);
  EXPECT_EQ(road.counts().device_time_gaps, 0U);
}

TEST(SweepAssembler, cuts_where_it_is_told_to) {
  Road road({.assemble = {.cut_azimuth_rad = rad_from_deg(90.0)}});
  road.drive(2 * kPacketsPerTurn);
  ASSERT_GE(road.sink.sweeps.size(), 2U);
  EXPECT_NEAR(road.sink.sweeps[1].returns.front().azimuth_rad, kPi / 2, 1e-6);
}

TEST(SweepAssembler, marks_a_revolution_with_a_lost_packet_as_incomplete) {
  Road road;
  road.drive(4 * kPacketsPerTurn, [](int i, RawPacket&) { return i != 400; });
  EXPECT_THAT(road.complete(), testing::ElementsAre(false, false, true, true));
  EXPECT_EQ(road.counts().device_time_gaps, 1U);
  EXPECT_EQ(road.sink.sweeps[1].returns.size(), kReturnsPerTurn - 384);
}

TEST(SweepAssembler, neither_joins_nor_splits_revolutions_when_the_packet_at_the_cut_is_lost) {
  for (int lost = 160; lost < 175; ++lost) {  // the cut lies in packet 166
    Road road;
    road.drive(4 * kPacketsPerTurn, [&](int i, RawPacket&) { return i < lost || i > lost + 1; });
    EXPECT_EQ(road.sink.sweeps.size(), 4U) << lost;
    EXPECT_EQ(road.counts().device_time_gaps, 2U);
    EXPECT_TRUE(road.sink.sweeps[2].complete && road.sink.sweeps[3].complete);
    if (lost == 166) {
      EXPECT_FALSE(road.sink.sweeps[1].complete) << "its beginning was lost";
    }
  }
}

TEST(SweepAssembler, ignores_a_head_that_shakes_back_and_forth_over_the_cut) {
  Road road;
  road.drive(3 * kPacketsPerTurn, [](int i, RawPacket& packet) {
    if (i % kPacketsPerTurn < 160 || i % kPacketsPerTurn > 172) return true;
    for (int block = 2; block < kBlocksPerPacket; block += 4) {
      const unsigned azimuth = block_azimuth_cdeg(packet.bytes, block) - 60U;
      put_azimuth_cdeg(packet.bytes, block, azimuth);
      put_azimuth_cdeg(packet.bytes, block + 1, azimuth);
    }
    return true;
  });
  EXPECT_THAT(road.complete(), testing::ElementsAre(false, true, true));
}

TEST(SweepAssembler, makes_no_sweeps_of_a_head_that_stands) {
  Road road;
  road.head = FakeHead(LidarModel::hdl64e_s2, 0);
  road.drive(20 * kPacketsPerTurn);
  road.driver.finish();
  EXPECT_TRUE(road.sink.sweeps.empty());
  EXPECT_EQ(road.counts().head_stopped, 1U);
  EXPECT_EQ(road.counts().sweep_overflow, 0U);
}

TEST(SweepAssembler, finds_its_way_back_when_a_head_that_stood_turns_again) {
  Road road;
  int standing_cdeg = 0;
  road.drive(8 * kPacketsPerTurn, [&](int i, RawPacket& packet) {
    if (i < 400) standing_cdeg = block_azimuth_cdeg(packet.bytes, 10);
    if (i >= 400 && i < 400 + 4 * kPacketsPerTurn) {
      for (int block = 0; block < kBlocksPerPacket; ++block)
        put_azimuth_cdeg(packet.bytes, block, static_cast<unsigned>(standing_cdeg));
    }
    return true;
  });
  EXPECT_EQ(road.counts().head_stopped, 1U);
  ASSERT_GE(road.sink.sweeps.size(), 3U);
  EXPECT_TRUE(road.sink.sweeps.back().complete);
  EXPECT_EQ(road.sink.sweeps.back().returns.size(), kReturnsPerTurn);
}

TEST(SweepAssembler, drops_whole_revolutions_while_the_ring_is_full) {
  Road road;
  road.drive(kPacketsPerTurn);  // in the second sweep
  road.sink.full = true;
  road.drive(2 * kPacketsPerTurn);  // it is finished; two more are refused
  road.sink.full = false;
  road.drive(2 * kPacketsPerTurn);
  EXPECT_EQ(road.counts().ring_full, 2U);
  EXPECT_EQ(road.sink.sweeps.size(), 3U);
  EXPECT_EQ(road.sink.sweeps.back().index, 4U) << "refused revolutions count";
  EXPECT_TRUE(road.sink.sweeps.back().complete);
}

TEST(SweepAssembler, never_grows_a_slot_and_counts_what_did_not_fit) {
  Road road;
  road.sink.capacity = 1000;
  road.drive(2 * kPacketsPerTurn);
  ASSERT_GE(road.sink.sweeps.size(), 2U);
  EXPECT_EQ(road.sink.sweeps[1].returns.size(), 1000U);
  EXPECT_FALSE(road.sink.sweeps[1].complete);
  EXPECT_GE(road.counts().sweep_overflow, kReturnsPerTurn - 1000);
}

TEST(SweepAssembler, keeps_times_from_going_back_when_arrivals_jitter) {
  Road road;
  road.drive(4 * kPacketsPerTurn, [](int i, RawPacket& packet) {
    packet.arrived = packet.arrived + (i % 7) * 100'000 - (i % 3) * 150'000;
    return true;
  });
  SensorTime last;
  for (const Sweep& sweep : road.sink.sweeps) {
    EXPECT_GE(sweep.start, last);
    EXPECT_TRUE(std::ranges::is_sorted(sweep.returns, {}, &Return::time_ns));
    EXPECT_GE(sweep.end - sweep.start, sweep.returns.back().time_ns);
    last = sweep.end;
  }
}

TEST(SweepAssembler, ends_a_sweep_at_a_pause_of_the_sensor) {
  Road road;
  road.drive(3 * kPacketsPerTurn, [](int i, RawPacket&) { return i < 400 || i > 400 + kPacketsPerTurn; });
  ASSERT_GE(road.sink.sweeps.size(), 3U);
  EXPECT_FALSE(road.sink.sweeps[1].complete);
  EXPECT_FALSE(road.sink.sweeps[2].complete);
  EXPECT_LT(road.sink.sweeps[1].end - road.sink.sweeps[1].start, 96'000'000);
  EXPECT_EQ(road.counts().device_time_gaps, static_cast<std::uint64_t>(kPacketsPerTurn) + 1);
}

TEST(SweepAssembler, keeps_a_sweep_together_when_packets_only_arrive_late) {
  Road road;
  road.drive(3 * kPacketsPerTurn, [](int i, RawPacket& packet) {
    // The player stalls for 120 ms, then sends what is due in one go.
    if (i >= 400) packet.arrived = packet.arrived + std::max(0, 120'000'000 - (i - 400) * 280'000);
    return true;
  });
  road.driver.finish();
  EXPECT_THAT(road.complete(), testing::ElementsAre(false, true, true, false));
  EXPECT_EQ(road.sink.sweeps[1].returns.size(), kReturnsPerTurn);
  EXPECT_EQ(road.counts().device_time_gaps, 0U);
}

TEST(SweepAssembler, ends_a_sweep_early_when_the_hosts_clock_leaps) {
  Road road;
  road.drive(3 * kPacketsPerTurn, [](int i, RawPacket& packet) {
    if (i >= 400) packet.arrived = packet.arrived + 1'000'000'000;
    return true;
  });
  road.driver.finish();
  EXPECT_THAT(road.complete(), testing::ElementsAre(false, false, false, true, false));
  EXPECT_LT(road.sink.sweeps[1].end - road.sink.sweeps[1].start, 96'000'000);
  EXPECT_EQ(road.counts().clock_steps, 1U);
}

TEST(SweepAssembler, goes_on_when_the_hosts_clock_is_set_back) {
  Road road;
  road.drive(6 * kPacketsPerTurn, [](int i, RawPacket& packet) {
    if (i >= 2 * kPacketsPerTurn) packet.arrived = packet.arrived - 3600'000'000'000;
    return true;
  });
  EXPECT_GE(road.sink.sweeps.size(), 6U);
  EXPECT_TRUE(road.sink.sweeps.back().complete);
  EXPECT_NEAR(static_cast<double>(road.sink.sweeps.back().end - road.sink.sweeps.back().start), 96e6, 1e5);
}

TEST(SweepAssembler, drops_a_late_packet_at_the_cut_and_makes_no_extra_sweep) {
  Road road;
  std::optional<RawPacket> late;
  road.drive(3 * kPacketsPerTurn, [&](int i, RawPacket& packet) {
    if (i == 166) {
      late = packet;
      return false;
    }
    if (i == 167) {
      road.driver.add(packet);
      road.driver.add(*late);
      return false;
    }
    return true;
  });
  EXPECT_EQ(road.sink.sweeps.size(), 3U);
  EXPECT_EQ(road.counts().reordered, 1U);
}

TEST(SweepAssembler, survives_any_packet_bytes) {
  std::uint32_t state = 1;
  for (const LidarModel model : {LidarModel::hdl64e_s2, LidarModel::hdl32e, LidarModel::vlp16}) {
    Bench bench(model);
    FakeHead head(model);
    for (int i = 0; i < 2000; ++i) {
      RawPacket packet = head.next();
      for (int byte = 0; byte < 40; ++byte) {
        state = state * 1664525U + 1013904223U;
        const std::size_t at = (state >> 8) % kPacketBytes;
        if (at < 1200 && at % kBlockBytes < 2) continue;  // flags stay, or nothing would get through
        packet.bytes[at] = static_cast<std::uint8_t>(state >> 24);
      }
      bench.driver.add(packet);
    }
    bench.driver.finish();
    for (const Sweep& sweep : bench.sink.sweeps) {
      EXPECT_LE(sweep.returns.size(), max_returns_per_sweep(model));
      EXPECT_TRUE(std::ranges::is_sorted(sweep.returns, {}, &Return::time_ns));
    }
  }
}

}  // namespace
}  // namespace roadvec
