#include "drivers/imu/log_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/imu/xsens.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

class ImuLogTest : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path()); }
  std::string path(const std::string& ending = ".log") {
    path_ =
        testing::TempDir() + "roadvec_imu_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ending;
    return path_;
  }
  std::unique_ptr<ImuReader> reader_of(const std::string& text) {
    std::ofstream(path(), std::ios::binary) << text;
    auto reader = open_imu_recording(path_);
    EXPECT_TRUE(reader);
    return *std::move(reader);
  }
  std::string path_;
};

TEST_F(ImuLogTest, each_line_gives_its_time_and_bytes) {
  const auto reader = reader_of("(1317042272.183702) faff36\r\n\n(1.5) 0A \n");
  ImuBytes bytes;
  ASSERT_EQ(reader->read(bytes, {}), ImuReadResult::bytes);
  EXPECT_TRUE(bytes.has_time);
  EXPECT_EQ(bytes.time.ns, 1317042272183702000);
  EXPECT_THAT(bytes.bytes, testing::ElementsAre(0xFA, 0xFF, 0x36));
  ASSERT_EQ(reader->read(bytes, {}), ImuReadResult::bytes);
  EXPECT_EQ(bytes.time.ns, 1500000000);
  EXPECT_THAT(bytes.bytes, testing::ElementsAre(0x0A));
  EXPECT_EQ(reader->read(bytes, {}), ImuReadResult::end);
  EXPECT_EQ(reader->counters().byte_count, 4U);
  EXPECT_EQ(reader->counters().bad_line_count, 0U);
}

TEST_F(ImuLogTest, bad_lines_are_counted_and_the_first_is_named) {
  const auto reader =
      reader_of("(1.0) 00\nfaff\n(2.0) 0\n(3.0) 0g\n(4.0)\n(5) 00\n(6.0) " + std::string(10000, 'a') + "\n(7.0) 11");
  ImuBytes bytes;
  ASSERT_EQ(reader->read(bytes, {}), ImuReadResult::bytes);
  ASSERT_EQ(reader->read(bytes, {}), ImuReadResult::bytes);
  EXPECT_EQ(bytes.time.ns, 7000000000);
  EXPECT_EQ(reader->read(bytes, {}), ImuReadResult::end);
  EXPECT_EQ(reader->counters().bad_line_count, 6U);
  EXPECT_EQ(reader->counters().first_bad_line, 2U);
}

TEST_F(ImuLogTest, a_message_may_run_over_two_lines) {
  const auto reader = reader_of("(1.0) faff360f80200c00000000\n(2.0) 000000003f80000051\n");
  XsensDecoder decoder({});
  ImuBytes bytes;
  MotionSample sample;
  ASSERT_EQ(reader->read(bytes, {}), ImuReadResult::bytes);
  EXPECT_FALSE(decoder.next(bytes, sample));
  ASSERT_EQ(reader->read(bytes, {}), ImuReadResult::bytes);
  ASSERT_TRUE(decoder.next(bytes, sample));
  EXPECT_EQ(sample.time.ns, 2000000000);
}

TEST_F(ImuLogTest, a_name_that_ends_in_bin_is_read_raw) {
  std::ofstream(path(".bin"), std::ios::binary) << "(1.0) 00";
  auto reader = open_imu_recording(path_);
  ASSERT_TRUE(reader);
  ImuBytes bytes;
  ASSERT_EQ((*reader)->read(bytes, {}), ImuReadResult::bytes);
  EXPECT_FALSE(bytes.has_time);
  EXPECT_EQ(bytes.bytes.size(), 8U);
  EXPECT_EQ((*reader)->read(bytes, {}), ImuReadResult::end);
  std::filesystem::remove(path_);
}

TEST(ImuLog, a_file_that_cannot_be_read_is_an_error_that_names_it) {
  EXPECT_THAT(open_imu_recording("/nowhere/imu.log").error().message, HasSubstr("/nowhere/imu.log"));
  EXPECT_THAT(open_imu_recording("/nowhere/imu.bin").error().message, HasSubstr("/nowhere/imu.bin"));
}

}  // namespace
}  // namespace roadvec
