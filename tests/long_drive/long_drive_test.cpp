#include <gtest/gtest.h>

#include "core/geometry/segment.h"
#include "core/pipeline/back_end.h"
#include "tests/support/city.h"

namespace roadvec {
namespace {

struct Half {
  double keyframe_count = 0, attempt_count = 0, looked_at_count = 0, solved_node_count = 0, rederived_count = 0;
  explicit Half(const BackEndReport& r)
      : keyframe_count(static_cast<double>(r.keyframe_count)),
        attempt_count(static_cast<double>(r.loops.attempt_count)),
        looked_at_count(static_cast<double>(r.loops.looked_at_count)),
        solved_node_count(static_cast<double>(r.solved_node_count)),
        rederived_count(static_cast<double>(r.rederived_keyframe_count)) {}
  Half operator-(const Half& before) const {
    Half difference = *this;
    difference.keyframe_count -= before.keyframe_count;
    difference.attempt_count -= before.attempt_count;
    difference.looked_at_count -= before.looked_at_count;
    difference.solved_node_count -= before.solved_node_count;
    difference.rederived_count -= before.rederived_count;
    return difference;
  }
};

/// Share of the map's vertices within `tolerance_m` of the truth.
double share_near(const BackEnd& back_end, const worlds::City& city, double tolerance_m) {
  double near = 0, all = 0;
  for (const auto& [id, line] : back_end.map()) {
    for (const Vertex& v : line.vertices) {
      double best_m2 = 1e9;
      for (const worlds::Points& kerb : city.around(v.position())) {
        for (std::size_t i = 1; i < kerb.size(); ++i) {
          best_m2 = std::min(best_m2, Segment{kerb[i - 1], kerb[i]}.distance2_m2(v.position()));
        }
      }
      all += 1;
      near += best_m2 <= tolerance_m * tolerance_m ? 1 : 0;
    }
  }
  return near / all;
}

TEST(LongDrive, through_the_same_streets_again_and_again_closes_no_false_loop_and_costs_no_more) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const worlds::City city(3, seed);
    worlds::CityDrive drive(city, city.drive(2400, seed), {.noise_m = 0.03}, worlds::city_drift(), seed);
    NoProbe probe;
    BackEnd back_end(PipelineConfig{}, {}, probe);
    std::optional<Half> first;
    while (drive.next()) {
      static_cast<void>(back_end.add(drive.keyframe));
      if (!first && drive.keyframe.travelled_m > 1200) first = Half(back_end.report());
    }
    const Half second = Half(back_end.report()) - *first;
    static_cast<void>(back_end.finish());
    EXPECT_GT(back_end.report().loops.accepted_count, 100U) << "seed " << seed;
    EXPECT_EQ(worlds::count_false(back_end.loops(), drive.truth()), 0U) << "seed " << seed;
    double greatest_m = 0;
    for (std::size_t k = 0; k < drive.truth().size(); ++k) {
      const Eigen::Vector2d ours = back_end.trajectory()[k].T_map_vehicle.translation();
      greatest_m = std::max(greatest_m, (ours - drive.truth()[k].translation()).norm());
    }
    EXPECT_LT(greatest_m, 1.0) << "seed " << seed;
    EXPECT_GT(share_near(back_end, city, 0.5), 0.9) << "seed " << seed;
    // 12 streets of two kerbs, with bays and the outsides of the corners: not a second kerb beside any.
    EXPECT_LT(back_end.report().map_length_m, 12 * 2 * 100 * 1.3) << "seed " << seed;
    // A place is entered once however often it is passed: no more than what lies within 50 m of a crossing.
    EXPECT_LT(second.looked_at_count / second.attempt_count, 150) << "seed " << seed;
    EXPECT_LT(second.solved_node_count / second.keyframe_count, 80) << "seed " << seed;
    EXPECT_LT(second.rederived_count / second.keyframe_count, 20) << "seed " << seed;
  }
}

}  // namespace
}  // namespace roadvec
