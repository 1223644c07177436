#include "tools/import/kitti_raw.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "daemon/config/load.h"
#include "drivers/velodyne/calibration.h"
#include "tests/support/temporary_folder.h"
#include "tests/tools/import/made_kitti.h"
#include "tools/import/report_text.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

/// One drive for all tests: five scans, and behind them one of 53 lasers, one cut off and one that is not there.
class KittiRaw : public testing::Test {
 protected:
  static constexpr int kGood = 5, kFrames = 8;

  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    drive_ = *folder_ / "day/drive_sync";
    MadeKitti::write_frame_of_drive(drive_, kFrames);
    for (int i = 0; i < kGood; ++i) {
      MadeKitti::write(MadeKitti::scan_path(drive_, i), MadeKitti::bytes_of(MadeKitti::scan(i)));
    }
    const std::string whole = bytes_of(MadeKitti::scan_path(drive_, 0));
    // The upper 53 lasers of the made-up head see all around: 2149 points each.
    MadeKitti::write(MadeKitti::scan_path(drive_, kGood), whole.substr(0, 53UL * 2149 * 16));
    MadeKitti::write(MadeKitti::scan_path(drive_, kGood + 1), whole.substr(0, whole.size() - 5));
    out_ = *folder_ / "out";
    report_ = import_kitti_raw(drive_, out_, [](std::string_view, double) {});
  }
  static void TearDownTestSuite() {
    report_ = fail("");
    folder_.reset();
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::filesystem::path drive_, out_;
  static Expected<ImportReport> report_;
};
std::unique_ptr<TemporaryFolder> KittiRaw::folder_;
std::filesystem::path KittiRaw::drive_, KittiRaw::out_;
Expected<ImportReport> KittiRaw::report_ = fail("");

TEST_F(KittiRaw, decoding_the_packets_gives_every_point_back_to_a_millimetre) {
  ASSERT_TRUE(report_) << report_.error().message;
  EXPECT_EQ(report_->frame_count, static_cast<std::size_t>(kGood));
  EXPECT_GT(report_->point_count, 600'000U);
  EXPECT_EQ(report_->lost_point_count, 0U);
  EXPECT_EQ(report_->round_trip.missing_count, 0U);
  EXPECT_LT(report_->round_trip.max_m, 0.0013);
  EXPECT_LT(report_->round_trip.median_m, 0.0006);
  EXPECT_TRUE(report_->faithful());
}

TEST_F(KittiRaw, the_calibration_is_that_of_the_head_up_to_what_points_cannot_tell) {
  ASSERT_TRUE(report_) << report_.error().message;
  const auto found = load_calibration(out_ / "db.xml");
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->lasers.size(), 64U);
  const double turned_rad = found->lasers[0].rotation_rad - MadeKitti::rotation_rad(0);
  // Millimetres leave the lowest lasers, which see 3.2 to 4.2 m and no more, a little freedom.
  for (int i = 0; i < MadeKitti::kLasers; ++i) {
    const LaserCalibration& laser = found->lasers[static_cast<std::size_t>(i)];
    EXPECT_NEAR(deg_from_rad(laser.elevation_rad), deg_from_rad(MadeKitti::elevation_rad(i)), 0.02) << i;
    EXPECT_NEAR(laser.vertical_offset_m, MadeKitti::up_m(i), 0.0015) << i;
    EXPECT_NEAR(laser.horizontal_offset_m, MadeKitti::side_m(i), 1e-9) << i;
    EXPECT_NEAR(deg_from_rad(laser.rotation_rad - turned_rad), deg_from_rad(MadeKitti::rotation_rad(i)), 0.002) << i;
    // Distances are known to whole steps of 2 mm.
    EXPECT_NEAR(std::remainder(laser.distance_m - MadeKitti::distance_m(i), 0.002), 0, 0.0006) << i;
  }
}

TEST_F(KittiRaw, damaged_scans_are_named_and_left_out) {
  ASSERT_TRUE(report_) << report_.error().message;
  const std::string text = text_of(*report_, "out");
  EXPECT_THAT(text, HasSubstr("left out: 0000000005: 53 lasers in place of 64\n"));
  EXPECT_THAT(text, HasSubstr("left out: 0000000006: "));
  EXPECT_THAT(text, HasSubstr("bytes are no whole number of points\n"));
  EXPECT_THAT(text, HasSubstr("left out: 0000000007: there is no such scan\n"));
  EXPECT_THAT(json_of(*report_, "out"), HasSubstr("\"first\":\"0000000005\",\"last\":\"0000000005\",\"count\":1"));
}

TEST_F(KittiRaw, the_path_is_the_one_that_was_driven) {
  ASSERT_TRUE(report_) << report_.error().message;
  EXPECT_NEAR(report_->distance_m, 4 * MadeKitti::kSweep_s * MadeKitti::kSpeed_mps, 0.02);
  std::istringstream file(bytes_of(out_ / "truth/poses.tum"));
  double t_s = 0, x_m = 0, y_m = 0, z_m = 0, qx = 0, qy = 0, qz = 0, qw = 0;
  int pose_count = 0;
  for (; file >> t_s >> x_m >> y_m >> z_m >> qx >> qy >> qz >> qw; ++pose_count) {
    const double time_s = t_s - 1e-9 * static_cast<double>(MadeKitti::kStart_ns);
    const Eigen::Isometry3d truth =
        MadeKitti::lidar_at(time_s) * Eigen::Translation3d(Eigen::Vector3d(-0.76, 0, -1.73));
    EXPECT_NEAR(x_m, truth.translation().x(), 0.03) << time_s;
    EXPECT_NEAR(y_m, truth.translation().y(), 0.03) << time_s;
    EXPECT_NEAR(deg_from_rad(2 * std::atan2(qz, qw)), deg_from_rad(MadeKitti::kYawRate_radps * time_s), 0.3);
  }
  EXPECT_EQ(pose_count, 51);
  EXPECT_NEAR(report_->lidar.roll_deg, 0, 0.05);
  EXPECT_NEAR(report_->lidar.pitch_deg, 0, 0.05);
  EXPECT_NEAR(report_->lidar.yaw_deg, 0, 0.3);
  EXPECT_NEAR(report_->anchor.yaw_deg, 0, 0.1);
  EXPECT_NEAR(report_->anchor.latitude_deg, 49.0, 1e-6);
}

TEST_F(KittiRaw, the_daemon_takes_the_drive) {
  ASSERT_TRUE(report_) << report_.error().message;
  const auto settings = load_drive(out_);
  EXPECT_TRUE(settings) << settings.error().message;
}

TEST_F(KittiRaw, a_drive_folder_that_is_there_is_not_overwritten) {
  const auto again = import_kitti_raw(drive_, out_, [](std::string_view, double) {});
  ASSERT_FALSE(again);
  EXPECT_THAT(again.error().message, HasSubstr("name another one"));
}

TEST(KittiRawErrors, what_is_missing_is_named) {
  const TemporaryFolder folder;
  const std::filesystem::path drive = folder / "day/drive_sync";
  const auto message = [&] {
    const auto report = import_kitti_raw(drive, folder / "out", [](std::string_view, double) {});
    return report ? "" : report.error().message;
  };
  EXPECT_THAT(message(), HasSubstr("has no folder oxts"));
  MadeKitti::write_frame_of_drive(drive, 3);
  EXPECT_THAT(message(), HasSubstr("has no scans"));
  MadeKitti::write(MadeKitti::scan_path(drive, 0), std::string(160, '\0'));
  EXPECT_THAT(message(), HasSubstr("it is empty"));
  std::filesystem::remove(folder / "day/calib_imu_to_velo.txt");
  EXPECT_THAT(message(), HasSubstr("calib_imu_to_velo.txt"));
  std::filesystem::remove(drive / "velodyne_points/timestamps_end.txt");
  MadeKitti::write(folder / "day/calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n");
  EXPECT_THAT(message(), HasSubstr("timestamps_end.txt"));
  MadeKitti::write(drive / "oxts/timestamps.txt", "yesterday\n");
  EXPECT_THAT(message(), testing::AllOf(HasSubstr("oxts/timestamps.txt:1: "), HasSubstr("yesterday")));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

}  // namespace
}  // namespace roadvec
