#include "daemon/stages/wall_clock.h"

#include <gtest/gtest.h>

namespace roadvec {
namespace {

constexpr std::int64_t kMillisecond_ns = 1'000'000, kSecond_ns = 1'000'000'000, kHour_ns = 3600 * kSecond_ns;

/// Both clocks of a machine, in steps of 10 ms; each look comes 1 ms after what it is to judge was stamped.
struct Machine {
  std::int64_t steady_ns = 50 * kSecond_ns, offset_ns = 1'700'000'000 * kSecond_ns;
  WallClock clock;
  [[nodiscard]] SensorTime stamp() const { return {steady_ns + offset_ns}; }
  void look() {
    steady_ns += kMillisecond_ns;
    clock.look(steady_ns, steady_ns + offset_ns, steady_ns + 100);
  }
};

TEST(WallClock, takes_steps_out_of_stamps_from_before_and_after_them) {
  for (const std::int64_t step_ns : {kHour_ns, -kHour_ns, kSecond_ns, -kSecond_ns, 60 * kMillisecond_ns}) {
    Machine machine;
    machine.look();
    const std::int64_t start_ns = machine.offset_ns;
    for (int i = 0; i < 100; ++i) {
      const SensorTime before = machine.stamp();
      const std::int64_t before_ns = machine.steady_ns;
      if (i == 50) machine.offset_ns += step_ns;
      machine.steady_ns += 9 * kMillisecond_ns;
      const SensorTime after = machine.stamp();
      const std::int64_t after_ns = machine.steady_ns;
      machine.look();
      EXPECT_EQ(machine.clock.without_steps(before).ns, before_ns + start_ns) << step_ns << " " << i;
      EXPECT_EQ(machine.clock.without_steps(after).ns, after_ns + start_ns) << step_ns << " " << i;
      EXPECT_EQ(machine.clock.age_ns(before), 10 * kMillisecond_ns) << step_ns << " " << i;
    }
    EXPECT_EQ(machine.clock.step_count(), 1U);
    EXPECT_EQ(machine.clock.last_step_ns(), step_ns);
  }
}

TEST(WallClock, adds_steps_up) {
  Machine machine;
  machine.look();
  const std::int64_t start_ns = machine.offset_ns;
  for (const std::int64_t step_ns : {kHour_ns, -kSecond_ns, -kHour_ns}) {
    machine.offset_ns += step_ns;
    machine.look();
    EXPECT_EQ(machine.clock.without_steps(machine.stamp()).ns, machine.steady_ns + start_ns);
  }
  EXPECT_EQ(machine.clock.step_count(), 3U);
}

TEST(WallClock, takes_slow_corrections_and_interruptions_for_no_steps) {
  Machine machine;
  machine.look();
  for (int i = 0; i < 10'000; ++i) {
    machine.offset_ns += 5000;  // 500 parts in a million
    machine.steady_ns += 9 * kMillisecond_ns;
    machine.look();
  }
  EXPECT_EQ(machine.clock.without_steps(machine.stamp()), machine.stamp());
  // Interrupted for 80 ms between two readings.
  machine.clock.look(machine.steady_ns, machine.steady_ns + 80 * kMillisecond_ns + machine.offset_ns,
                     machine.steady_ns + 80 * kMillisecond_ns);
  machine.steady_ns += 80 * kMillisecond_ns;
  machine.look();
  EXPECT_EQ(machine.clock.step_count(), 0U);
}

}  // namespace
}  // namespace roadvec
