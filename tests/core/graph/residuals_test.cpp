#include "core/graph/residuals.h"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace roadvec {
namespace {

TEST(RelativePoseCost, jacobians_equal_central_differences) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> metres(-20, 20), turn(-kPi, kPi), entry(-2, 2);
    Eigen::Matrix3d sqrt_information;
    for (int i = 0; i < 9; ++i) sqrt_information(i / 3, i % 3) = entry(random);
    std::array<double, 3> i{metres(random), metres(random), turn(random)},
        j{metres(random), metres(random), turn(random)};
    // Near the measured turn, so that the angle's error does not wrap between two differences.
    const Pose2 z{metres(random), metres(random), wrap_rad(j[2] - i[2] + 0.2 * entry(random))};
    const RelativePoseCost cost(z, sqrt_information);
    const std::array<const double*, 2> parameters{i.data(), j.data()};
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_i, by_j;
    std::array<double*, 2> jacobians{by_i.data(), by_j.data()};
    Eigen::Vector3d e;
    ASSERT_TRUE(cost.Evaluate(parameters.data(), e.data(), jacobians.data()));
    const double h = 1e-6;
    for (int k = 0; k < 6; ++k) {
      double& x = k < 3 ? i[static_cast<std::size_t>(k)] : j[static_cast<std::size_t>(k - 3)];
      const double kept = x;
      Eigen::Vector3d above, below;
      x = kept + h;
      ASSERT_TRUE(cost.Evaluate(parameters.data(), above.data(), nullptr));
      x = kept - h;
      ASSERT_TRUE(cost.Evaluate(parameters.data(), below.data(), nullptr));
      x = kept;
      const Eigen::Vector3d analytic = k < 3 ? by_i.col(k) : by_j.col(k - 3);
      EXPECT_LT((analytic - (above - below) / (2 * h)).norm(), 1e-5) << "seed " << seed << " parameter " << k;
    }
  }
}

TEST(RelativePoseError, is_zero_for_the_measured_pose_and_takes_the_short_way_round) {
  const Pose2 x_i{3, -2, 3.0}, z{5, 1, 0.5};
  EXPECT_LT(relative_pose_error(x_i, x_i * z, z).norm(), 1e-12);
  EXPECT_NEAR(relative_pose_error({0, 0, 0}, {0, 0, 3.1}, {0, 0, -3.1}).z(), 6.2 - kTwoPi, 1e-12);
}

}  // namespace
}  // namespace roadvec
