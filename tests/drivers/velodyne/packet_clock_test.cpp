#include "drivers/velodyne/packet_clock.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "tests/drivers/velodyne/packets.h"

namespace roadvec {
namespace {

constexpr std::uint32_t kDuration_ns = 288'000;

/// A clock under test and a sensor whose packets come every 288 us, on both clocks.
struct ClockBench {
  explicit ClockBench(const PacketClockOptions& options = {}) : clock(options, counters) {}

  PacketTiming place(std::int64_t packet_number, std::int64_t arrival_jitter_ns = 0) {
    return place_at(first_device_us + packet_number * 288,
                    first_arrival_ns + packet_number * 288'000 + arrival_jitter_ns, packet_number);
  }
  PacketTiming place_at(std::int64_t device_us, std::int64_t arrived_ns, std::int64_t packet_number,
                        std::uint32_t duration_ns = kDuration_ns) {
    RawPacket packet;
    packet.arrived = {arrived_ns};
    put_device_time_us(packet.bytes, static_cast<std::uint32_t>(device_us % device_hour_us));
    return clock.place(packet, duration_ns,
                       static_cast<std::uint16_t>((packet_number * 108 + 720'000) % kFullCircle_cdeg));
  }
  [[nodiscard]] LidarCounts counts() const { return snapshot(counters); }

  std::int64_t first_device_us = 1'000'000'000, device_hour_us = 3'600'000'000;
  std::int64_t first_arrival_ns = 1'700'000'000'000'000'000;
  LidarCounters counters;
  PacketClock clock;
};

TEST(PacketClock, takes_the_arrival_for_the_end_of_the_last_firing) {
  ClockBench bench;
  EXPECT_EQ(bench.place(0).first_firing.ns, bench.first_arrival_ns - kDuration_ns);
  EXPECT_EQ(bench.place(1, 5000).first_firing.ns, bench.first_arrival_ns + 5000);
}

TEST(PacketClock, counts_the_packets_missing_between_two) {
  ClockBench bench;
  EXPECT_EQ(bench.place(0).lost_before_count, 0U);
  EXPECT_EQ(bench.place(1).lost_before_count, 0U);
  EXPECT_EQ(bench.place(5).lost_before_count, 3U);
  EXPECT_EQ(bench.counts().device_time_gaps, 3U);
}

TEST(PacketClock, counts_nothing_missing_after_a_packet_that_spans_what_a_limited_field_of_view_leaves_out) {
  ClockBench bench;
  constexpr std::uint32_t kLong_ns = 50'000'000;  // half a turn left out inside the packet
  const auto place = [&](std::int64_t after_us, std::int64_t number, std::uint32_t duration_ns) {
    return bench.place_at(bench.first_device_us + after_us, bench.first_arrival_ns + after_us * 1000, number,
                          duration_ns);
  };
  EXPECT_EQ(place(0, 0, kDuration_ns).lost_before_count, 0U);
  EXPECT_EQ(place(288, 1, kLong_ns).lost_before_count, 0U);
  EXPECT_EQ(place(50'288, 2, kDuration_ns).lost_before_count, 0U);
  EXPECT_EQ(place(50'576, 3, kDuration_ns).lost_before_count, 0U);
  EXPECT_EQ(bench.counts().device_time_gaps, 0U);
}

TEST(PacketClock, drops_a_late_packet_and_a_duplicate) {
  ClockBench bench;
  EXPECT_FALSE(bench.place(0).stale);
  EXPECT_FALSE(bench.place(2).stale);
  EXPECT_TRUE(bench.place(1).stale);
  EXPECT_TRUE(bench.place(2).stale);
  EXPECT_FALSE(bench.place(3).stale);
  EXPECT_EQ(bench.counts().reordered, 2U);
  EXPECT_EQ(bench.counts().device_time_gaps, 1U) << "the late packet was missing once";
}

TEST(PacketClock, goes_on_when_the_hour_wraps) {
  ClockBench bench;
  bench.first_device_us = 3'600'000'000 - 3 * 288;
  for (int i = 0; i < 6; ++i) {
    const PacketTiming timing = bench.place(i);
    EXPECT_FALSE(timing.stale);
    EXPECT_EQ(timing.lost_before_count, 0U);
  }
  EXPECT_EQ(bench.counts().clock_steps, 0U);
}

TEST(PacketClock, knows_a_late_packet_even_across_the_hour) {
  ClockBench bench;
  bench.first_device_us = 3'600'000'000 - 2 * 288;
  EXPECT_FALSE(bench.place(0).stale);
  EXPECT_FALSE(bench.place(2).stale);  // past the hour
  EXPECT_TRUE(bench.place(1).stale);   // before it
  EXPECT_FALSE(bench.place(3).stale);
  EXPECT_EQ(bench.counts().device_time_gaps, 1U);
  EXPECT_EQ(bench.counts().reordered, 1U);
}

TEST(PacketClock, bears_a_sensor_whose_hour_is_too_long) {
  ClockBench bench({.base = PacketTimeBase::device});
  bench.device_hour_us = 3'600'060'000;
  bench.first_device_us = 3'600'060'000 - 2 * 288;
  std::int64_t previous_ns = 0;
  for (int i = 0; i < 5; ++i) {
    const PacketTiming timing = bench.place(i);
    EXPECT_FALSE(timing.stale);
    if (i > 0) {
      EXPECT_EQ(timing.first_firing.ns - previous_ns, 288'000);
    }
    previous_ns = timing.first_firing.ns;
  }
}

TEST(PacketClock, takes_a_jump_of_the_sensors_clock_for_neither_loss_nor_reordering) {
  ClockBench bench;
  EXPECT_FALSE(bench.place(0).stale);
  bench.first_device_us += 900'000'000;
  const PacketTiming ahead = bench.place(1);
  EXPECT_FALSE(ahead.stale);
  EXPECT_EQ(ahead.lost_before_count, 0U);
  bench.first_device_us -= 5'000;
  EXPECT_FALSE(bench.place(2).stale);
  EXPECT_EQ(bench.counts().clock_steps, 2U);
}

TEST(PacketClock, tells_how_far_and_when_a_clock_stepped) {
  ClockBench bench;
  bench.place(0);
  EXPECT_EQ(bench.clock.state().last_step, std::nullopt);
  bench.first_device_us += 900'000'000;
  bench.place(1);
  EXPECT_EQ(bench.clock.state().last_step->size_ns, 900'000'000'000);
  bench.first_arrival_ns -= 30'000'000'000;  // the host is set back by half a minute
  const SensorTime arrived{bench.first_arrival_ns + 2 * 288'000};
  bench.place(2);
  EXPECT_EQ(bench.clock.state().last_step->size_ns, 30'000'000'000);
  EXPECT_EQ(bench.clock.state().last_step->time, arrived);
  EXPECT_EQ(bench.counts().clock_steps, 2U);
}

TEST(PacketClock, a_host_set_back_a_little_is_a_step_and_no_reordering) {
  ClockBench bench;
  bench.place(0);
  bench.first_arrival_ns -= 200'000'000;
  EXPECT_FALSE(bench.place(1).stale);
  EXPECT_EQ(bench.counts().clock_steps, 1U);
  EXPECT_EQ(bench.counts().device_time_gaps, 0U);
}

TEST(PacketClock, tells_how_the_stamps_stand_to_the_host) {
  ClockBench bench;  // the host is 800 s past an hour, the sensor says 1000 s
  bench.place(0);
  EXPECT_EQ(bench.clock.state().device_minus_host_ns, 200'000'000'000 + kDuration_ns);
}

TEST(PacketClock, utc_stamps_go_on_over_the_hour_whether_they_tell_of_the_first_or_the_last_firing) {
  constexpr std::int64_t kFullHour_ns = 1'700'000'000'000'000'000 + 2'800'000'000'000;
  for (const PacketStampMeaning meaning : {PacketStampMeaning::first_firing, PacketStampMeaning::last_firing}) {
    ClockBench bench({.base = PacketTimeBase::device_utc, .stamp = meaning});
    bench.first_arrival_ns = kFullHour_ns - 3 * 288'000 + 100;  // the hour is full inside a packet
    bench.first_device_us = 3'600'000'000 - 3 * 288 - 100;
    std::int64_t previous_ns = bench.place(0).first_firing.ns;
    for (int i = 1; i < 8; ++i) {
      const PacketTiming timing = bench.place(i);
      EXPECT_FALSE(timing.stale);
      EXPECT_EQ(timing.first_firing.ns - previous_ns, 288'000);
      previous_ns = timing.first_firing.ns;
    }
    EXPECT_EQ(bench.counts().clock_steps, 0U);
  }
}

TEST(PacketClock, keeps_even_intervals_by_the_sensors_clock_whatever_delays_the_arrivals) {
  ClockBench bench({.base = PacketTimeBase::device});
  bench.place(0);
  for (int i = 1; i < 100; ++i) {
    const std::int64_t jitter_ns = (i * 7919) % 1'000'000;
    EXPECT_NEAR(static_cast<double>(bench.place(i, jitter_ns).first_firing.ns),
                static_cast<double>(bench.first_arrival_ns - kDuration_ns + i * 288'000), 3000);
  }
}

TEST(PacketClock, follows_a_sensor_whose_crystal_is_slow) {
  ClockBench bench({.base = PacketTimeBase::device});
  PacketTiming timing;
  SensorTime arrived;
  for (std::int64_t i = 0; i < 200'000; ++i) {
    const std::int64_t drift_ns = i * 288 / 20;  // 50 parts in a million
    arrived = {bench.first_arrival_ns + i * 288'000 + drift_ns};
    timing = bench.place(i, drift_ns);
  }
  EXPECT_NEAR(static_cast<double>(arrived - timing.first_firing), kDuration_ns, 1000);
}

TEST(PacketClock, reads_the_stamp_as_utc_and_the_hour_from_the_arrival) {
  // 1 700 000 000 s is 800 s past an hour. The sensor's clock agrees to 2 ms with the host's.
  const auto first_firing = [](PacketStampMeaning meaning, std::int64_t device_us, std::int64_t arrived_ns) {
    ClockBench bench({.base = PacketTimeBase::device_utc, .stamp = meaning});
    return bench.place_at(device_us, arrived_ns, 0).first_firing.ns;
  };
  constexpr std::int64_t kHost_ns = 1'700'000'000'000'000'000;
  EXPECT_EQ(first_firing(PacketStampMeaning::first_firing, 799'998'000, kHost_ns), kHost_ns - 2'000'000);
  EXPECT_EQ(first_firing(PacketStampMeaning::last_firing, 799'998'000, kHost_ns), kHost_ns - 2'000'000 - kDuration_ns);
  constexpr std::int64_t kFullHour_ns = kHost_ns + 2'800'000'000'000;
  EXPECT_EQ(first_firing(PacketStampMeaning::first_firing, 3'599'999'000, kFullHour_ns + 500'000),
            kFullHour_ns - 1'000'000);
  EXPECT_EQ(first_firing(PacketStampMeaning::first_firing, 3'600'060'000, kFullHour_ns + 61'000'000),
            kFullHour_ns + 60'000'000);
}

TEST(PacketClock, points_never_go_back_within_a_sweep_whatever_the_clocks_do) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    std::mt19937 random(seed);
    const auto base = static_cast<PacketTimeBase>(seed % 3);
    const auto meaning = static_cast<PacketStampMeaning>(seed / 3 % 2);
    Bench bench(LidarModel::hdl32e, {.decode = {}, .clock = {.base = base, .stamp = meaning}, .assemble = {}});
    FakeHead head(LidarModel::hdl32e);
    head.device_us = 3'599'900'000;  // the hour is soon full
    RawPacket held = head.next();
    for (int i = 0; i < 1000; ++i) {
      RawPacket packet = head.next();
      const auto event = random() % 200;
      if (event == 0) head.device_us += 1'800'000'000 - static_cast<std::int64_t>(random() % 3'600'000'000);
      if (event == 1)
        head.arrival = head.arrival + (2'000'000'000 - static_cast<std::int64_t>(random() % 4'000'000'000));
      if (event == 2) packet.arrived = packet.arrived + static_cast<std::int64_t>(random() % 50'000'000);
      if (event == 3) std::swap(packet, held);
      if (event != 4) bench.driver.add(packet);
    }
    bench.driver.finish();
    for (const Sweep& sweep : bench.sink.sweeps) {
      EXPECT_LE(sweep.start, sweep.end);
      EXPECT_TRUE(std::is_sorted(sweep.returns.begin(), sweep.returns.end(),
                                 [](const Return& a, const Return& b) { return a.time_ns < b.time_ns; }))
          << "seed " << seed;
      if (!sweep.returns.empty()) {
        EXPECT_LE(sweep.returns.back().time_ns, sweep.end - sweep.start) << "seed " << seed;
      }
    }
  }
}

}  // namespace
}  // namespace roadvec
