#include "drivers/velodyne/model.h"

#include <gmock/gmock.h>

namespace roadvec {
namespace {

using testing::HasSubstr;

TEST(LidarModel, is_found_by_the_name_a_drive_uses) {
  for (const char* name : {"HDL-64E S2", "HDL-32E", "VLP-16"}) {
    const auto model = lidar_model_from(name);
    ASSERT_TRUE(model.has_value()) << name;
    EXPECT_EQ(name_of(*model), name);
  }
}

TEST(LidarModel, that_is_known_but_not_decoded_is_refused_by_name) {
  const auto model = lidar_model_from("VLS-128");
  ASSERT_FALSE(model.has_value());
  EXPECT_THAT(model.error().message, HasSubstr("\"VLS-128\" is known but not decoded"));
}

TEST(LidarModel, that_is_unknown_names_the_ones_to_choose_from) {
  const auto model = lidar_model_from("HDL64");
  ASSERT_FALSE(model.has_value());
  EXPECT_THAT(model.error().message, HasSubstr("\"HDL64\""));
  EXPECT_THAT(model.error().message, HasSubstr("\"HDL-64E S2\", \"HDL-32E\", \"VLP-16\""));
}

TEST(LidarModel, fires_its_lanes_in_order_and_within_the_group_period) {
  for (const LidarModel model : {LidarModel::hdl64e_s2, LidarModel::hdl32e, LidarModel::vlp16}) {
    for (int lane = 1; lane < kLanesPerBlock; ++lane)
      EXPECT_LE(lane_time_ns(model, lane - 1), lane_time_ns(model, lane));
    EXPECT_LT(lane_time_ns(model, kLanesPerBlock - 1), facts_of(model).group_period_ns);
  }
}

TEST(LidarModel, vlp16_fires_its_sixteen_lasers_twice_in_a_block) {
  EXPECT_EQ(laser_of(LidarModel::vlp16, 0, 3), 3);
  EXPECT_EQ(laser_of(LidarModel::vlp16, 0, 19), 3);
  EXPECT_EQ(lane_time_ns(LidarModel::vlp16, 19) - lane_time_ns(LidarModel::vlp16, 3), 55'296U);
}

TEST(LidarModel, reserves_room_for_a_revolution_at_five_turns_a_second) {
  EXPECT_GE(max_returns_per_sweep(LidarModel::hdl64e_s2), 200'000'000U / 48'000U * 64U);
  EXPECT_LE(max_returns_per_sweep(LidarModel::hdl64e_s2), 350'000U);
}

}  // namespace
}  // namespace roadvec
