#include "drivers/velodyne/nmea.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <string>

namespace roadvec {
namespace {

/// With '$', star and the right checksum around it.
std::string sentence(const std::string& body, const std::string& end = "\r\n") {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  std::array<char, 4> digits{};
  std::snprintf(digits.data(), digits.size(), "*%02X", sum);
  return "$" + body + digits.data() + end;
}

NmeaFix read(const std::string& text, NmeaResult expected = NmeaResult::fix) {
  NmeaFix fix;
  EXPECT_EQ(parse_nmea(text, fix), expected) << text;
  return fix;
}

TEST(Nmea, rmc_tells_time_date_place_speed_and_course) {
  const NmeaFix fix = read(sentence("GPRMC,130211.25,A,4900.5000,N,00824.2500,E,019.4,084.4,230394,003.1,W"));
  EXPECT_TRUE(fix.valid);
  ASSERT_TRUE(fix.utc && fix.place && fix.speed_mps && fix.course_deg);
  EXPECT_EQ(fix.utc->ns, 764'427'731'250'000'000);  // date -u -d '1994-03-23 13:02:11' +%s
  EXPECT_EQ(fix.time_of_day_ns, ((13 * 60 + 2) * 60 + 11) * 1'000'000'000LL + 250'000'000);
  EXPECT_NEAR(fix.place->latitude_deg, 49 + 0.5 / 60, 1e-12);
  EXPECT_NEAR(fix.place->longitude_deg, 8 + 24.25 / 60, 1e-12);
  EXPECT_NEAR(*fix.speed_mps, 19.4 * 1852 / 3600, 1e-12);
  EXPECT_NEAR(*fix.course_deg, 84.4, 1e-12);
  EXPECT_FALSE(fix.height_m);
}

TEST(Nmea, gga_tells_the_height_above_the_ellipsoid_and_no_date) {
  const NmeaFix fix = read(sentence("GNGGA,130211,3707.8324,S,12139.2864,W,1,08,0.9,545.4,M,-46.9,M,,"));
  ASSERT_TRUE(fix.valid && fix.place && fix.height_m && fix.time_of_day_ns);
  EXPECT_NEAR(fix.place->latitude_deg, -(37 + 7.8324 / 60), 1e-12);
  EXPECT_NEAR(fix.place->longitude_deg, -(121 + 39.2864 / 60), 1e-12);
  EXPECT_NEAR(*fix.height_m, 498.5, 1e-9);
  EXPECT_FALSE(fix.utc);
}

TEST(Nmea, a_receiver_without_fix_is_believed_its_time_and_no_place) {
  const NmeaFix fix = read(sentence("GPRMC,130211,V,,,,,,,010170,,"));
  EXPECT_FALSE(fix.valid);
  EXPECT_FALSE(fix.place);
  EXPECT_FALSE(read(sentence("GPGGA,130211,,,,,0,00,,,M,,M,,")).valid);
  EXPECT_FALSE(read(sentence("GPRMC,,V,,,,,,,,,,N")).time_of_day_ns);
}

TEST(Nmea, the_checksum_is_found_by_its_star_whatever_follows) {
  const std::string body = "GPRMC,220632,A,3707.8324,N,12139.2864,W,000.0,144.7,111212,013.8,E,D";
  for (const std::string& end : {std::string(), std::string("\r\n"), std::string("\n"), std::string("\0\0", 2)})
    EXPECT_TRUE(read(sentence(body, end)).valid);
  std::string wrong = sentence(body);
  wrong[10] = '9';
  read(wrong, NmeaResult::bad_checksum);
  read("$" + body, NmeaResult::malformed);
  read("$" + body + "*", NmeaResult::bad_checksum);
  read("$" + body + "*0", NmeaResult::bad_checksum);
}

TEST(Nmea, leap_days_and_the_turn_of_the_year_are_on_their_day) {
  const auto day = [](const std::string& date) {
    return read(sentence("GPRMC,000000,V,,,,,,," + date + ",,")).utc->ns / 86'400'000'000'000;
  };
  EXPECT_EQ(day("010170"), 18'262 + 18'263);  // 2070: two digits below 80 are of this century
  EXPECT_EQ(day("010100"), 10'957);
  EXPECT_EQ(day("290224") + 1, day("010324"));
  EXPECT_EQ(day("311223") + 1, day("010124"));
  EXPECT_EQ(day("280223") + 1, day("010323"));
}

TEST(Nmea, what_is_no_fix_says_so) {
  read("", NmeaResult::malformed);
  read("GPRMC", NmeaResult::malformed);
  read(sentence("GPGSV,3,1,11"), NmeaResult::other_sentence);
  read(sentence(""), NmeaResult::other_sentence);
  for (const char* body : {"GPRMC", "GPRMC,250000,A,4900,N,00824,E,0,0,230394,,", "GPRMC,130211,X,,,,,,,230394,,",
                           "GPRMC,130211,A,4900,Q,00824,E,0,0,230394,,", "GPRMC,130211,A,9900,N,00824,E,0,0,230394,,",
                           "GPRMC,130211,A,nan,N,00824,E,0,0,230394,,", "GPRMC,130211,A,4900,N,00824,E,0,0,321394,,",
                           "GPGGA,1302,4900,N,00824,E,1,8,1,1,M,1,M"})
    read(sentence(body), NmeaResult::malformed);
}

}  // namespace
}  // namespace roadvec
