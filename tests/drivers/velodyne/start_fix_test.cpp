#include "drivers/velodyne/start_fix.h"

#include <gtest/gtest.h>

namespace roadvec {
namespace {

NmeaFix driving() {
  NmeaFix fix;
  fix.valid = true;
  fix.place = NmeaFix::Place{49.0, 8.4};
  fix.speed_mps = 5.0;
  fix.course_deg = 30.0;
  return fix;
}

TEST(StartFixFinder, takes_the_course_of_a_vehicle_that_drives_for_its_heading) {
  StartFixFinder finder;
  const auto fix = finder.add(driving());
  ASSERT_TRUE(fix);
  EXPECT_EQ(fix->latitude_deg, 49.0);
  EXPECT_EQ(fix->yaw_deg, 60.0);  // 30 degrees from north, clockwise
  EXPECT_FALSE(fix->height_m);
}

TEST(StartFixFinder, waits_while_there_is_no_fix_no_course_or_no_speed) {
  StartFixFinder finder;
  NmeaFix invalid = driving(), nowhere = driving(), slow = driving(), aimless = driving();
  invalid.valid = false;
  nowhere.place.reset();
  slow.speed_mps = 2.0;
  aimless.course_deg.reset();
  for (const NmeaFix& fix : {invalid, nowhere, slow, aimless}) EXPECT_FALSE(finder.add(fix));
}

TEST(StartFixFinder, remembers_the_height_that_another_sentence_told) {
  StartFixFinder finder;
  NmeaFix gga;
  gga.valid = true;
  gga.place = NmeaFix::Place{49.0, 8.4};
  gga.height_m = 112.0;
  EXPECT_FALSE(finder.add(gga));
  EXPECT_EQ(finder.add(driving())->height_m, 112.0);
}

}  // namespace
}  // namespace roadvec
