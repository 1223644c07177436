#include "core/map/match.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "tests/support/worlds.h"

namespace roadvec {
namespace {

using worlds::View;

PoseCovariance no_prior() { return Eigen::Vector3d(1e4, 1e4, 1e2).asDiagonal(); }
PoseCovariance odometry_prior(double sigma_m = 0.3, double sigma_rad = 0.03) {
  return Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
}
Pose2 disturbed(const Pose2& pose, double shift_m, double turn_deg, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const double angle = kPi * unit(random), length = shift_m * unit(random),
               turn = rad_from_deg(turn_deg) * unit(random);
  return {pose.x_m + length * std::cos(angle), pose.y_m + length * std::sin(angle), pose.theta_rad + turn};
}
double distance_m(const Pose2& a, const Pose2& b) { return (a.translation() - b.translation()).norm(); }

TEST(NodeToLine, jacobian_equals_central_differences) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> u(-20.0, 20.0), turn(-kPi, kPi);
    const Pose2 pose{u(random), u(random), turn(random)};
    const Eigen::Vector2d p(u(random), u(random)), q(u(random), u(random));
    const double a = turn(random);
    const Eigen::Vector2d n(std::cos(a), std::sin(a));
    const double h = 1e-6;
    const auto r = [&](double dx, double dy, double dt) {
      return node_to_line({pose.x_m + dx, pose.y_m + dy, pose.theta_rad + dt}, p, q, n).residual_m;
    };
    const Eigen::Vector3d numeric((r(h, 0, 0) - r(-h, 0, 0)) / (2 * h), (r(0, h, 0) - r(0, -h, 0)) / (2 * h),
                                  (r(0, 0, h) - r(0, 0, -h)) / (2 * h));
    EXPECT_LT((node_to_line(pose, p, q, n).jacobian - numeric).norm(), 1e-6) << "seed " << seed;
  }
}

TEST(Matcher, finds_a_known_motion_to_a_millimetre_without_noise) {
  const worlds::World world = worlds::crossing();
  Matcher matcher{MatchConfig{}};
  matcher.set_reference(worlds::truth(world));
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937_64 random(seed);
    const Pose2 truth = disturbed({}, 3.0, 180.0, random);
    const LineSet seen = worlds::seen_from(world, truth, {.tolerance_m = 0}, random);
    const Match& match = matcher.run(seen, disturbed(truth, 0.5, 3.0, random), no_prior());
    ASSERT_EQ(match.verdict, MatchVerdict::accepted) << "seed " << seed;
    EXPECT_LT(distance_m(match.pose, truth), 1e-3) << "seed " << seed;
    EXPECT_LT(std::abs(wrap_rad(match.pose.theta_rad - truth.theta_rad)), 1e-4) << "seed " << seed;
    EXPECT_GT(match.overlap, 0.97) << "seed " << seed;
  }
}

TEST(Matcher, noisy_simplified_lines_match_within_two_centimetres_and_the_covariance_says_so) {
  const worlds::World world = worlds::crossing();
  Matcher matcher{MatchConfig{}};
  double squares_m2 = 0, normed = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937_64 random(seed);
    const View view{.noise_m = 0.03, .tolerance_m = 0.06};
    const Pose2 truth = disturbed({}, 2.0, 180.0, random);
    matcher.set_reference(worlds::seen_from(world, {}, view, random));
    const LineSet seen = worlds::seen_from(world, truth, view, random);
    const Match& match = matcher.run(seen, disturbed(truth, 0.5, 3.0, random), no_prior());
    ASSERT_TRUE(match.usable()) << "seed " << seed;
    const Eigen::Vector3d error(match.pose.x_m - truth.x_m, match.pose.y_m - truth.y_m,
                                wrap_rad(match.pose.theta_rad - truth.theta_rad));
    squares_m2 += error.head<2>().squaredNorm();
    normed += error.dot(match.covariance.inverse() * error);
  }
  EXPECT_LT(std::sqrt(squares_m2 / 200), 0.02);
  RecordProperty("rms_mm", static_cast<int>(1000 * std::sqrt(squares_m2 / 200)));
  RecordProperty("nees", std::to_string(normed / 200));
  // Three degrees of freedom: 3 would be exact. Simplification adds what no sigma tells.
  EXPECT_GT(normed / 200, 0.3);
  EXPECT_LT(normed / 200, 6.0);
}

TEST(Matcher, a_straight_street_reports_the_road_direction_and_leaves_the_guess_untouched_along_it) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937_64 random(seed);
    const double road_rad = kPi * std::uniform_real_distribution<double>(-1.0, 1.0)(random);
    worlds::World world = worlds::straight_street(-60, 60);
    for (worlds::Points& line : world) {
      for (Eigen::Vector2d& p : line) p = Pose2{0, 0, road_rad} * p;
    }
    Matcher matcher{MatchConfig{}};
    const View view{.noise_m = 0.03};
    matcher.set_reference(worlds::seen_from(world, {}, view, random));
    const Eigen::Vector2d road(std::cos(road_rad), std::sin(road_rad)), across(-road.y(), road.x());
    const Pose2 truth{0.8 * road.x(), 0.8 * road.y(), road_rad};
    const Pose2 guess = disturbed(truth, 0.5, 3.0, random);
    const Match& match = matcher.run(worlds::seen_from(world, truth, view, random), guess, odometry_prior());
    ASSERT_EQ(match.verdict, MatchVerdict::partly_observable) << "seed " << seed;
    ASSERT_TRUE(match.unobservable.has_value());
    EXPECT_GT(std::abs(match.unobservable->dot(road)), std::cos(rad_from_deg(2.0))) << "seed " << seed;
    EXPECT_NEAR(road.dot(match.pose.translation() - guess.translation()), 0.0, 0.03) << "seed " << seed;
    EXPECT_LT(std::abs(across.dot(match.pose.translation() - truth.translation())), 0.06) << "seed " << seed;
    // No information along the road from the lines; the covariance there is the guess's.
    const Eigen::Vector3d along(match.unobservable->x(), match.unobservable->y(), 0);
    EXPECT_NEAR(std::sqrt(along.dot(match.covariance * along)), 0.3, 0.01) << "seed " << seed;
    EXPECT_LT(std::sqrt(match.covariance(2, 2)), 0.01);
  }
}

TEST(Matcher, one_wall_alone_says_nothing_along_itself) {
  Matcher matcher{MatchConfig{}};
  const worlds::World world{{{-30, 3}, {30, 3}}};
  std::mt19937_64 random(1);
  matcher.set_reference(worlds::truth(world));
  const Match& match = matcher.run(worlds::seen_from(world, {1, 0.2, 0.02}, {}, random), {1.4, 0, 0}, odometry_prior());
  ASSERT_EQ(match.verdict, MatchVerdict::partly_observable);
  EXPECT_NEAR(match.pose.x_m, 1.4, 1e-6);
  EXPECT_NEAR(match.pose.y_m, 0.2, 2e-3);
  EXPECT_NEAR(match.pose.theta_rad, 0.02, 1e-4);
}

TEST(Matcher, outliers_do_not_pull) {
  worlds::World world = worlds::crossing();
  Matcher matcher{MatchConfig{}};
  matcher.set_reference(worlds::truth(world));
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937_64 random(seed);
    // A row of parked cars 0.25 to 1 m in front of one kerb, and rubbish in the road.
    worlds::World disturbed_world = world;
    const double offset_m = 0.25 + 0.75 * std::uniform_real_distribution<double>()(random);
    disturbed_world.push_back({{-25, 4 - offset_m}, {-10, 4 - offset_m}});
    disturbed_world.push_back({{3, 1}, {5, 0}, {6, -1}});
    const Pose2 truth = disturbed({}, 2.0, 180.0, random);
    const LineSet seen = worlds::seen_from(disturbed_world, truth, {.noise_m = 0.01}, random);
    const Match& match = matcher.run(seen, disturbed(truth, 0.5, 3.0, random), no_prior());
    ASSERT_TRUE(match.usable()) << "seed " << seed;
    EXPECT_LT(distance_m(match.pose, truth), 0.03) << "seed " << seed << " offset " << offset_m;
  }
}

TEST(Matcher, lines_of_the_other_side_of_an_island_are_no_partners) {
  // An island 0.4 m thin: seen from below, its near face only; the far face runs the other way.
  Matcher matcher{MatchConfig{}};
  matcher.set_reference(worlds::truth({{{-20, 4.4}, {20, 4.4}}, {{20, 4.8}, {-20, 4.8}}}));
  std::mt19937_64 random(3);
  const LineSet seen = worlds::seen_from({{{-20, 4.0}, {20, 4.0}}}, {}, {}, random);
  const Match& match = matcher.run(seen, {0, 0.6, 0}, odometry_prior(1.0));
  ASSERT_TRUE(match.usable());
  EXPECT_NEAR(match.pose.y_m, 0.4, 0.01);
}

TEST(Matcher, says_why_there_is_no_match) {
  Matcher matcher{MatchConfig{}};
  std::mt19937_64 random(1);
  const LineSet seen = worlds::seen_from(worlds::crossing(), {}, {}, random);
  const Pose2 guess{1, 2, 0.1};

  matcher.set_reference(LineSet{});
  EXPECT_EQ(matcher.run(seen, guess, no_prior()).verdict, MatchVerdict::too_few_lines);
  EXPECT_EQ(matcher.run(seen, guess, no_prior()).pose, guess);

  matcher.set_reference(worlds::truth(worlds::crossing()));
  EXPECT_EQ(matcher.run(LineSet{}, guess, no_prior()).verdict, MatchVerdict::too_few_lines);

  matcher.set_reference(worlds::truth({{{-40, 4}, {-32, 4}}}));
  EXPECT_EQ(matcher.run(seen, {-10, 0, 0}, no_prior()).verdict, MatchVerdict::poor_overlap);

  MatchConfig strict;
  strict.max_shift_m = 0.1;
  Matcher strict_matcher{strict};
  strict_matcher.set_reference(worlds::truth(worlds::crossing()));
  EXPECT_EQ(strict_matcher.run(seen, {0.4, 0.3, 0}, no_prior()).verdict, MatchVerdict::diverged);
  EXPECT_EQ(strict_matcher.run(seen, {0.4, 0.3, 0}, no_prior()).information, Eigen::Matrix3d::Zero());
}

TEST(Matcher, a_sure_guess_outweighs_lines_and_a_vague_one_does_not) {
  const worlds::World world = worlds::crossing();
  Matcher matcher{MatchConfig{}};
  matcher.set_reference(worlds::truth(world));
  std::mt19937_64 random(5);
  const LineSet seen = worlds::seen_from(world, {}, {}, random);
  const Pose2 guess{0.1, 0, 0};
  EXPECT_NEAR(matcher.run(seen, guess, odometry_prior(1e-5, 1e-6)).pose.x_m, 0.1, 1e-3);
  EXPECT_NEAR(matcher.run(seen, guess, odometry_prior(1.0, 0.1)).pose.x_m, 0.0, 1e-3);
}

TEST(Matcher, the_same_input_gives_the_same_bytes) {
  const worlds::World world = worlds::crossing();
  std::mt19937_64 random(7);
  const LineSet reference = worlds::seen_from(world, {}, {.noise_m = 0.03}, random);
  const LineSet seen = worlds::seen_from(world, {1, 0, 0.1}, {.noise_m = 0.03}, random);
  Matcher first{MatchConfig{}}, second{MatchConfig{}};
  first.set_reference(reference);
  const Pose2 once = first.run(seen, {1.3, 0.2, 0.08}, no_prior()).pose;
  second.set_reference(seen);
  second.set_reference(reference);
  static_cast<void>(second.run(reference, {}, no_prior()));
  EXPECT_EQ(second.run(seen, {1.3, 0.2, 0.08}, no_prior()).pose, once);
}

}  // namespace
}  // namespace roadvec
