#include "tools/simulate/random.h"

#include <gtest/gtest.h>

namespace roadvec {
namespace {

TEST(Random, normal_noise_has_the_bell_curves_moments_and_tails) {
  Random random(1, 2);
  constexpr int kCount = 4'000'000;
  double sum = 0, sum2 = 0, sum4 = 0;
  std::array<int, 5> beyond{};
  int above_zero = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    sum += x;
    sum2 += x * x;
    sum4 += x * x * x * x;
    above_zero += x > 0 ? 1 : 0;
    for (std::size_t sigma = 1; sigma < beyond.size(); ++sigma)
      beyond[sigma] += std::abs(x) > static_cast<double>(sigma) ? 1 : 0;
  }
  EXPECT_NEAR(sum / kCount, 0, 0.003);
  EXPECT_NEAR(sum2 / kCount, 1, 0.004);
  EXPECT_NEAR(sum4 / kCount, 3, 0.03);
  EXPECT_NEAR(above_zero, kCount / 2, 6000);
  for (std::size_t sigma = 1; sigma < beyond.size(); ++sigma) {
    const double expected = kCount * std::erfc(static_cast<double>(sigma) / std::sqrt(2.0));
    EXPECT_NEAR(beyond[sigma], expected, 6 * std::sqrt(expected)) << sigma << " sigma";
  }
}

TEST(Random, streams_of_a_seed_differ_and_repeat) {
  Random a(7, 1), again(7, 1), b(7, 2);
  const double first = a.normal();
  EXPECT_EQ(first, again.normal());
  EXPECT_NE(first, b.normal());
}

}  // namespace
}  // namespace roadvec
