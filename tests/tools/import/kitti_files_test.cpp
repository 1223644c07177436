#include "tools/import/kitti_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>

namespace roadvec {
namespace {

using testing::HasSubstr;

TEST(KittiFiles, a_time_keeps_its_nanoseconds) {
  EXPECT_EQ(parse_kitti_time("1970-01-02 00:00:01.5")->ns, 86'401'500'000'000);
  EXPECT_EQ(parse_kitti_time("2011-09-26 13:04:32.349659964")->ns, 1'317'042'272'349'659'964);
  EXPECT_EQ(parse_kitti_time("2011-09-26 13:04:32.349659964\r\n")->ns, 1'317'042'272'349'659'964);
}

TEST(KittiFiles, what_is_no_time_is_refused) {
  for (const char* text :
       {"", "2011-09-26", "2011-09-26 13:04:32", "2011-09-26 13:04:32.", "2011-13-26 13:04:32.1",
        "2011-02-30 13:04:32.1", "2011-09-26 24:04:32.1", "2011-09-26 13:60:32.1", "2011-09-26 13:04:32.1 x",
        "2011-09-26 13:04:32.1234567890", "1969-12-31 23:59:59.9", "2011-9-26 13:04:32.1"}) {
    const auto time = parse_kitti_time(text);
    ASSERT_FALSE(time) << text;
    EXPECT_THAT(time.error().message, HasSubstr("no time"));
  }
}

const char* const kRow =
    "49.01 8.42 112.8 0.02 1e-05 -1.22 -3.3 1.1 3.5 0.04 -0.04 -0.3 0.1 9.99 -0.31 -0.2 9.98 -0.01 0.02 0.14 -0.02 "
    "0.02 0.15 0.49 0.07 4 10 4 4 0";

TEST(KittiFiles, an_oxts_row_is_read_in_its_order) {
  const auto sample = parse_oxts(std::string(kRow) + "\n");
  ASSERT_TRUE(sample) << sample.error().message;
  EXPECT_EQ(sample->latitude_deg, 49.01);
  EXPECT_EQ(sample->longitude_deg, 8.42);
  EXPECT_EQ(sample->height_m, 112.8);
  EXPECT_EQ(sample->roll_rad, 0.02);
  EXPECT_EQ(sample->pitch_rad, 1e-5);
  EXPECT_EQ(sample->yaw_rad, -1.22);
  EXPECT_EQ(sample->north_mps, -3.3);
  EXPECT_EQ(sample->east_mps, 1.1);
  EXPECT_EQ(sample->forward_mps, 3.5);
  EXPECT_EQ(sample->leftward_mps, -0.04) << "the file has it to the right";
  EXPECT_EQ(sample->acceleration_mps2, Eigen::Vector3d(-0.3, 0.1, 9.99));
  EXPECT_EQ(sample->rate_radps, Eigen::Vector3d(-0.01, 0.02, 0.14));
}

TEST(KittiFiles, a_row_cut_off_or_of_another_kind_is_refused) {
  const std::string row = kRow;
  EXPECT_FALSE(parse_oxts(""));
  EXPECT_FALSE(parse_oxts(row.substr(0, row.size() - 2)));
  EXPECT_FALSE(parse_oxts(row + " 1"));
  EXPECT_FALSE(parse_oxts("nan" + row.substr(5)));
  EXPECT_FALSE(parse_oxts("149" + row.substr(2)));
}

TEST(KittiFiles, a_calibration_is_found_behind_its_other_lines) {
  const auto rigid = parse_rigid("calib_time: 25-May-2012 16:47:16\nR: 0 -1 0 1 0 0 0 0 1\nT: -0.8 0.3 -0.7\nx: 1\n");
  ASSERT_TRUE(rigid) << rigid.error().message;
  EXPECT_TRUE((*rigid * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(-0.8, 1.3, -0.7)));
  EXPECT_FALSE(parse_rigid("R: 1 0 0 0 1 0 0 0 1\n")) << "no T";
  EXPECT_THAT(parse_rigid("R: 2 0 0 0 1 0 0 0 1\nT: 0 0 0\n").error().message, HasSubstr("rotation"));
  EXPECT_FALSE(parse_rigid("R: 1 0 0 0 1 0 0 0 -1\nT: 0 0 0\n")) << "a mirror";
}

std::vector<std::uint8_t> floats(std::initializer_list<float> values) {
  std::vector<std::uint8_t> bytes(4 * values.size());
  std::memcpy(bytes.data(), values.begin(), bytes.size());
  return bytes;
}

TEST(KittiFiles, a_scan_is_four_floats_a_point_and_its_end_is_no_point) {
  const auto points = parse_scan(floats({1, 2, 3, 0.5F, 4, 5, 6, 1, 0, 0, 0, 0}));
  ASSERT_TRUE(points) << points.error().message;
  ASSERT_EQ(points->size(), 2U);
  EXPECT_EQ((*points)[1].y_m, 5);
  EXPECT_EQ((*points)[0].reflectance, 0.5F);
}

TEST(KittiFiles, a_scan_cut_off_or_with_points_that_are_none_is_refused) {
  auto bytes = floats({1, 2, 3, 0.5F});
  bytes.pop_back();
  EXPECT_THAT(parse_scan(bytes).error().message, HasSubstr("15 bytes"));
  EXPECT_FALSE(parse_scan(floats({1, std::numeric_limits<float>::quiet_NaN(), 3, 0.5F})));
  EXPECT_FALSE(parse_scan(floats({1, 2, std::numeric_limits<float>::infinity(), 0.5F})));
  EXPECT_FALSE(parse_scan(floats({1, 2, 3, 1.5F})));
  EXPECT_THAT(parse_scan(floats({1, 2, 3, 0, 900, 0, 0, 0})).error().message, HasSubstr("point 1"));
}

}  // namespace
}  // namespace roadvec
