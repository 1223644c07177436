#include <gtest/gtest.h>

#include "core/geometry/segment.h"
#include "core/pipeline/back_end.h"
#include "tests/support/city.h"

namespace roadvec {
namespace {

using worlds::City;
using worlds::CityDrive;

const worlds::View kView{.range_m = 30.0, .noise_m = 0.02};

PoseCovariance sure_to(double ahead_m, double aside_m, double heading_deg) {
  return Eigen::Vector3d(square(ahead_m), square(aside_m), square(rad_from_deg(heading_deg))).asDiagonal();
}

/// Two drives through one city; the second back end knows the first's drive as a file would bring it back. Both
/// odometries begin at the true pose, so that the map frame is the city's, and the right guess is the identity.
class RecallTest : public ::testing::Test {
 protected:
  static void drive(BackEnd& back_end, CityDrive drive) {
    while (drive.next()) back_end.add(drive.keyframe);
    back_end.finish();
  }
  [[nodiscard]] CityDrive route(unsigned seed, double length_m = 500) const {
    return {city_, city_.drive(length_m, seed), kView, worlds::city_drift(), seed + 100};
  }
  [[nodiscard]] Recollection what_is_kept_of(const BackEnd& back_end, std::vector<StartGuess> guesses) const {
    Recollection kept{back_end.graph(), {}, std::move(guesses)};
    for (const KeptKeyframe& k : back_end.keyframes()) {
      kept.keyframes.push_back({k.time,
                                {},
                                PackedLines::from_bytes(k.lvm.bytes()).value(),
                                PackedLines::from_bytes(k.structure.bytes()).value()});
    }
    return kept;
  }
  /// Mean distance of the map's vertices from the city's lines.
  [[nodiscard]] double mean_error_m(const VectorMap& map) const {
    double sum_m = 0;
    std::size_t count = 0;
    for (const auto& [id, line] : map) {
      for (const Vertex& v : line.vertices) {
        double best_m2 = 1e9;
        for (const worlds::Points& points : city_.around(v.position())) {
          for (std::size_t i = 1; i < points.size(); ++i) {
            best_m2 = std::min(best_m2, Segment{points[i - 1], points[i]}.distance2_m2(v.position()));
          }
        }
        sum_m += std::sqrt(best_m2);
        ++count;
      }
    }
    return sum_m / static_cast<double>(count);
  }

  City city_{6};
  NoProbe probe_;
  BackEnd first_{PipelineConfig{}, {}, probe_}, second_{PipelineConfig{}, {}, probe_};
};

TEST_F(RecallTest, a_second_drive_over_the_same_streets_adds_no_line_and_no_length) {
  drive(first_, route(1));
  second_.recall(what_is_kept_of(first_, {{{3, -2, rad_from_deg(3)}, sure_to(5, 5, 5)}}));
  CityDrive again(city_, city_.drive(500, 1), kView, worlds::city_drift(), 7);
  drive(second_, again);
  EXPECT_TRUE(second_.report().found_itself);
  EXPECT_LT(second_.report().searched_m, 100);
  EXPECT_TRUE(second_.has_recalled_all());
  EXPECT_NEAR(second_.report().map_length_m, first_.report().map_length_m, 0.02 * first_.report().map_length_m);
  EXPECT_LT(mean_error_m(second_.map()), 1.5 * mean_error_m(first_.map()) + 0.02);
}

TEST_F(RecallTest, a_drive_through_other_streets_too_goes_on_with_the_map) {
  drive(first_, route(1));
  second_.recall(what_is_kept_of(first_, {{{-3, 3, rad_from_deg(-3)}, sure_to(5, 5, 5)}}));
  drive(second_, route(5));
  BackEnd alone(PipelineConfig{}, {}, probe_);
  drive(alone, route(5));
  EXPECT_TRUE(second_.report().found_itself);
  EXPECT_GT(second_.report().map_length_m, 1.05 * first_.report().map_length_m);
  EXPECT_LT(second_.report().map_length_m, first_.report().map_length_m + alone.report().map_length_m);
  EXPECT_LT(mean_error_m(second_.map()), 1.5 * mean_error_m(first_.map()) + 0.02) << mean_error_m(first_.map());
}

TEST_F(RecallTest, until_it_has_found_itself_the_map_is_of_the_new_drive_alone) {
  drive(first_, route(1));
  // In the middle of a block, 300 m from where it is, and sure of it.
  second_.recall(what_is_kept_of(first_, {{{212, 212, 0}, sure_to(5, 5, 5)}}));
  drive(second_, route(1, 300));
  BackEnd alone(PipelineConfig{}, {}, probe_);
  drive(alone, route(1, 300));
  EXPECT_FALSE(second_.report().found_itself);
  EXPECT_FALSE(second_.has_recalled_all());
  EXPECT_NEAR(second_.report().map_length_m, alone.report().map_length_m, 0.02 * alone.report().map_length_m);
}

TEST_F(RecallTest, of_two_guesses_the_one_that_the_road_agrees_with_is_taken) {
  drive(first_, route(1));
  second_.recall(what_is_kept_of(first_, {{{212, 212, 0}, sure_to(5, 5, 5)}, {{2, 1, 0}, sure_to(5, 5, 5)}}));
  drive(second_, route(1));
  EXPECT_TRUE(second_.report().found_itself);
  EXPECT_NEAR(second_.report().map_length_m, first_.report().map_length_m, 0.02 * first_.report().map_length_m);
  EXPECT_LT(mean_error_m(second_.map()), 1.5 * mean_error_m(first_.map()) + 0.02) << mean_error_m(first_.map());
}

TEST_F(RecallTest, after_a_restart_on_the_way_the_map_is_as_if_there_had_been_none) {
  const std::vector<Pose2> way = city_.drive(500, 1);
  BackEnd undisturbed(PipelineConfig{}, {}, probe_);
  drive(undisturbed, route(1));
  const auto half = way.begin() + 125;  // in the middle of a block
  drive(first_, {city_, {way.begin(), half}, kView, worlds::city_drift(), 3});
  const Pose2 last = first_.graph().poses_map.back();
  const auto later = half + 12;  // 24 m on
  const StartGuess guess{last * Pose2{10, 0, 0} * later->inverse(), sure_to(10, 2, 3)};
  second_.recall(what_is_kept_of(first_, {guess}));
  drive(second_, {city_, {later, way.end()}, kView, worlds::city_drift(), 4});
  EXPECT_TRUE(second_.report().found_itself);
  EXPECT_NEAR(second_.report().map_length_m, undisturbed.report().map_length_m,
              0.03 * undisturbed.report().map_length_m);
  EXPECT_LT(mean_error_m(second_.map()), 1.5 * mean_error_m(first_.map()) + 0.02) << mean_error_m(first_.map());
}

TEST_F(RecallTest, the_same_drives_give_the_same_map) {
  drive(first_, route(1, 300));
  const std::vector<StartGuess> guesses{{{3, -2, 0}, sure_to(5, 5, 5)}};
  BackEnd third(PipelineConfig{}, {}, probe_);
  for (BackEnd* back_end : {&second_, &third}) {
    back_end->recall(what_is_kept_of(first_, guesses));
    drive(*back_end, route(5, 300));
  }
  ASSERT_EQ(second_.map().size(), third.map().size());
  for (const auto& [id, line] : second_.map()) EXPECT_EQ(third.map().at(id).vertices, line.vertices);
}

TEST(PackedLines, come_back_from_their_bytes_and_never_from_others) {
  LineSet lines;
  lines.begin_line({.kind = BoundaryKind::curb, .last_end = EndKind::open, .height_m = 0.12F, .existence = 0.9F});
  for (int i = 0; i < 5; ++i) lines.push_vertex({1.0 * i, 2.0, 0.1F, 0.12F, 0.02F, 0.3F});
  lines.begin_line({.kind = BoundaryKind::barrier, .observation_count = 7});
  lines.push_vertex({-3, 4, 0, 1, 0.1F, 0.1F});
  const PackedLines packed(lines);
  const std::vector<std::uint8_t> bytes = packed.bytes();
  LineSet before, after;
  packed.append_to(before);
  const std::optional<PackedLines> back = PackedLines::from_bytes(bytes);
  ASSERT_TRUE(back);
  back->append_to(after);
  EXPECT_EQ(before, after);
  const std::size_t second_begins = 20 + 5 * 10;
  for (std::size_t size = 1; size < bytes.size(); ++size) {
    EXPECT_EQ(PackedLines::from_bytes(std::span(bytes).first(size)).has_value(), size == second_begins) << size;
  }
  std::vector<std::uint8_t> wrong = bytes;
  wrong[4] = 5;  // no such kind
  EXPECT_FALSE(PackedLines::from_bytes(wrong));
  wrong = bytes;
  wrong[3] = 0xFF;  // four thousand million vertices
  EXPECT_FALSE(PackedLines::from_bytes(wrong));
}

}  // namespace
}  // namespace roadvec
