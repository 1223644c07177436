#include "core/ring/spsc_ring.h"

#include <gtest/gtest.h>

#include <thread>

#include "core/ring/latest.h"

namespace roadvec {
namespace {

TEST(SpscRing, refuses_when_full_and_takes_again_after_a_pop) {
  SpscRing<int, 4> ring;
  for (int i = 0; i < 4; ++i) {
    int* slot = ring.claim();
    ASSERT_NE(slot, nullptr);
    *slot = i;
    ring.publish();
  }
  EXPECT_EQ(ring.claim(), nullptr);
  ASSERT_NE(ring.front(), nullptr);
  EXPECT_EQ(*ring.front(), 0);
  ring.pop();
  EXPECT_NE(ring.claim(), nullptr);
  EXPECT_EQ(ring.size(), 3U);
}

TEST(SpscRing, hands_a_million_values_over_in_order) {
  SpscRing<std::uint64_t, 64> ring;
  constexpr std::uint64_t kCount = 1'000'000;
  std::jthread producer([&] {
    for (std::uint64_t i = 0; i < kCount;) {
      if (std::uint64_t* slot = ring.claim()) {
        *slot = i++;
        ring.publish();
      } else {
        std::this_thread::yield();
      }
    }
  });
  for (std::uint64_t expected = 0; expected < kCount;) {
    if (const std::uint64_t* slot = ring.front()) {
      ASSERT_EQ(*slot, expected++);
      ring.pop();
    } else {
      std::this_thread::yield();
    }
  }
  EXPECT_EQ(ring.front(), nullptr);
}

struct Pair {
  std::uint64_t value = 0, twice = 0;
};

TEST(Latest, reader_sees_whole_values_that_never_go_back) {
  Latest<Pair> mailbox;
  constexpr std::uint64_t kCount = 300'000;
  std::jthread writer([&] {
    for (std::uint64_t i = 1; i <= kCount; ++i) mailbox.store({i, 2 * i});
  });
  std::uint64_t last = 0;
  while (last < kCount) {
    const Pair seen = mailbox.load();
    ASSERT_EQ(seen.twice, 2 * seen.value);
    ASSERT_GE(seen.value, last);
    last = seen.value;
  }
}

}  // namespace
}  // namespace roadvec
