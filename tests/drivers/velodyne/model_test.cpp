#include "drivers/velodyne/model.h"

#include <gmock/gmock.h>

#include <set>

#include "tests/drivers/velodyne/packets.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

TEST(LidarModel, is_found_by_the_name_a_drive_uses) {
  for (const char* name : {"HDL-64E S2", "HDL-64E S3", "HDL-32E", "VLP-16", "Puck Hi-Res", "VLP-32C", "VLS-128"}) {
    const auto model = lidar_model_from(name);
    ASSERT_TRUE(model.has_value()) << name;
    EXPECT_EQ(name_of(*model), name);
  }
}

TEST(LidarModel, that_is_unknown_names_the_ones_to_choose_from) {
  const auto model = lidar_model_from("HDL64");
  ASSERT_FALSE(model.has_value());
  EXPECT_THAT(model.error().message, HasSubstr("\"HDL64\""));
  EXPECT_THAT(model.error().message, HasSubstr("\"HDL-64E S2\", \"HDL-64E S3\", \"HDL-32E\""));
}

TEST(LidarModel, fires_its_lanes_in_order_and_within_the_group_period) {
  for (const LidarModel model : kAllModels) {
    std::uint32_t last_ns = 0;
    for (int bank = 0; bank < facts_of(model).bank_count; ++bank) {
      if (facts_of(model).bank_count == 2) last_ns = 0;  // side by side
      for (int lane = 0; lane < kLanesPerBlock; ++lane) {
        EXPECT_LE(last_ns, lane_time_ns(model, bank, lane)) << name_of(model);
        last_ns = lane_time_ns(model, bank, lane);
      }
    }
    EXPECT_EQ(group_span_ns(model), last_ns);
    EXPECT_LT(last_ns, facts_of(model).group_period_ns) << name_of(model);
  }
}

TEST(LidarModel, sends_each_bank_and_echo_of_a_group_once) {
  for (const LidarModel model : kAllModels) {
    for (const bool dual : {false, true}) {
      if (dual && facts_of(model).dual == DualLayout::none) continue;
      const GroupLayout layout = group_layout(model, dual);
      std::set<std::pair<int, int>> seen;
      for (int i = 0; i < layout.block_count; ++i) {
        const GroupLayout::Block& block = layout.blocks[static_cast<std::size_t>(i)];
        seen.insert({block.bank, block.echo});
      }
      EXPECT_EQ(seen.size(), static_cast<std::size_t>(facts_of(model).bank_count * (dual ? 2 : 1)));
      EXPECT_EQ(seen.rbegin()->first, facts_of(model).bank_count - 1);
    }
  }
}

TEST(LidarModel, vls128_fires_eight_lasers_at_once_and_pauses_after_each_half) {
  EXPECT_EQ(lane_time_ns(LidarModel::vls128, 0, 0), lane_time_ns(LidarModel::vls128, 0, 7));
  EXPECT_EQ(lane_time_ns(LidarModel::vls128, 0, 8), 2'665U);
  EXPECT_EQ(lane_time_ns(LidarModel::vls128, 2, 0) - lane_time_ns(LidarModel::vls128, 1, 31), 3 * 2'665U);
  EXPECT_EQ(laser_of(LidarModel::vls128, 3, 31), 127);
}

TEST(LidarModel, vlp16_fires_its_sixteen_lasers_twice_in_a_block) {
  EXPECT_EQ(laser_of(LidarModel::vlp16, 0, 3), 3);
  EXPECT_EQ(laser_of(LidarModel::vlp16, 0, 19), 3);
  EXPECT_EQ(lane_time_ns(LidarModel::vlp16, 0, 19) - lane_time_ns(LidarModel::vlp16, 0, 3), 55'296U);
}

TEST(LidarModel, reserves_room_for_a_revolution_at_five_turns_a_second) {
  EXPECT_GE(max_returns_per_sweep(LidarModel::hdl64e_s2), 200'000'000U / 48'000U * 64U);
  EXPECT_LE(max_returns_per_sweep(LidarModel::hdl64e_s2), 350'000U);
}

}  // namespace
}  // namespace roadvec
