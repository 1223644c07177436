#include "drivers/velodyne/calibration.h"

#include <gmock/gmock.h>

#include <functional>

#include "core/base/angle.h"
#include "tests/drivers/velodyne/temp_file.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string list(const std::string& element, int count, const std::function<std::string(int)>& item) {
  std::string text = "<" + element + "><count>" + std::to_string(count) + "</count>";
  for (int i = 0; i < count; ++i) text += "<item>" + item(i) + "</item>";
  return text + "</" + element + ">";
}

std::string laser(int id) {
  return "<px><id_>" + std::to_string(id) + "</id_><rotCorrection_>" + std::to_string(id * 0.1) +
         "</rotCorrection_><vertCorrection_>-2.5</vertCorrection_><distCorrection_>130.5</distCorrection_>"
         "<distCorrectionX_>131</distCorrectionX_><distCorrectionY_>132</distCorrectionY_>"
         "<vertOffsetCorrection_>20.5</vertOffsetCorrection_><horizOffsetCorrection_>-2.6</horizOffsetCorrection_>"
         "<focalDistance_>1200</focalDistance_><focalSlope_>1.4</focalSlope_></px>";
}

std::string db_xml(const std::string& points, const std::string& rest = "<distLSB_>0.2</distLSB_>") {
  return "<?xml version=\"1.0\"?><!DOCTYPE boost_serialization><boost_serialization><DB>" + rest + points +
         "</DB></boost_serialization>";
}
std::string good_points() { return list("points_", 64, laser); }

std::string error_of(const std::string& text) {
  const auto calibration = parse_db_xml(text, "car/db.xml");
  return calibration ? "" : calibration.error().message;
}
std::string replaced(std::string text, const std::string& what, const std::string& by) {
  return text.replace(text.find(what), what.size(), by);
}

TEST(DbXml, is_read_in_centimetres_and_degrees) {
  const auto calibration = parse_db_xml(db_xml(good_points()), "db.xml");
  ASSERT_TRUE(calibration) << calibration.error().message;
  ASSERT_EQ(calibration->lasers.size(), 64U);
  EXPECT_DOUBLE_EQ(calibration->distance_lsb_m.value(), 0.002);
  const LaserCalibration& l = calibration->lasers[20];
  EXPECT_DOUBLE_EQ(l.rotation_rad, rad_from_deg(2.0));
  EXPECT_DOUBLE_EQ(l.elevation_rad, rad_from_deg(-2.5));
  EXPECT_DOUBLE_EQ(l.distance_m, 1.305);
  EXPECT_DOUBLE_EQ(l.distance_x_m, 1.31);
  EXPECT_DOUBLE_EQ(l.distance_y_m, 1.32);
  EXPECT_DOUBLE_EQ(l.vertical_offset_m, 0.205);
  EXPECT_DOUBLE_EQ(l.horizontal_offset_m, -0.026);
  EXPECT_DOUBLE_EQ(l.focal_distance_m, 12.0);
  EXPECT_DOUBLE_EQ(l.focal_slope, 1.4);
}

TEST(DbXml, puts_lasers_by_their_id_and_not_by_their_place) {
  const auto calibration = parse_db_xml(db_xml(list("points_", 64, [](int i) { return laser(63 - i); })), "db.xml");
  ASSERT_TRUE(calibration);
  EXPECT_DOUBLE_EQ(calibration->lasers[10].rotation_rad, rad_from_deg(1.0));
}

TEST(DbXml, may_hold_intensities_as_floats_and_disable_a_laser) {
  const std::string lists = list("enabled_", 64, [](int i) { return i == 5 ? "0" : "1"; }) +
                            list("minIntensity_", 64, [](int) { return "1.0e+01"; }) +
                            list("maxIntensity_", 64, [](int i) { return i == 7 ? "220.5" : " 255 "; });
  const auto calibration = parse_db_xml(db_xml(good_points() + lists), "db.xml");
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_FALSE(calibration->lasers[5].enabled);
  EXPECT_DOUBLE_EQ(calibration->lasers[0].min_intensity, 10);
  EXPECT_DOUBLE_EQ(calibration->lasers[7].max_intensity, 220.5);
}

TEST(DbXml, without_distLSB_leaves_the_step_to_the_model) {
  const auto calibration = parse_db_xml(db_xml(good_points(), ""), "db.xml");
  ASSERT_TRUE(calibration);
  EXPECT_FALSE(calibration->distance_lsb_m.has_value());
  EXPECT_TRUE(fit_to_model(*calibration, LidarModel::hdl64e_s2, "db.xml").has_value());
}

TEST(DbXml, of_an_old_head_may_lack_the_near_correction) {
  const auto without_x = [](int id) { return replaced(laser(id), "<distCorrectionX_>131</distCorrectionX_>", ""); };
  const auto calibration = parse_db_xml(db_xml(list("points_", 64, without_x)), "db.xml");
  ASSERT_TRUE(calibration);
  EXPECT_EQ(calibration->lasers[0].distance_x_m, 0.0);
}

TEST(DbXml, that_is_wrong_names_file_element_and_remedy) {
  const std::string good = db_xml(good_points());
  const std::pair<std::string, const char*> cases[] = {
      {"", "not XML"},
      {"<boost_serialization><DB>", "not XML"},
      {"<html/>", "<boost_serialization><DB> is missing"},
      {db_xml(""), "<points_> is missing"},
      {db_xml("<points_/>"), "<points_> has 0 items"},
      {replaced(good, "<count>64<", "<count>63<"), "<count> says 63 but there are 64"},
      {replaced(good, "<id_>12</id_>", "<id_>13</id_>"), "<id_> 13 occurs twice"},
      {replaced(good, "<id_>12</id_>", "<id_>64</id_>"), "<id_> is 64, not a laser of 0..63"},
      {replaced(good, "<id_>12</id_>", "<id_>-1</id_>"), "<id_> is -1"},
      {replaced(good, "<id_>12</id_>", "<id_>1.5</id_>"), "<id_> is 1.5"},
      {replaced(good, "<id_>12</id_>", ""), "item 12: element <id_> is missing"},
      {replaced(good, "<vertCorrection_>-2.5</vertCorrection_>", ""), "item 0: element <vertCorrection_> is missing"},
      {replaced(good, "-2.5", "-2,5"), "<vertCorrection_> is \"-2,5\", not a number"},
      {replaced(good, "-2.5", "nan"), "not a number"},
      {replaced(good, "-2.5", "120"), "an angle is out of range"},
      {replaced(good, "130.5", "1e9"), "exceeds 10 m"},
      {replaced(good, "<distLSB_>0.2", "<distLSB_>0"), "<distLSB_> is 0"},
      {db_xml(good_points() + list("minIntensity_", 32, [](int) { return "0"; })),
       "<minIntensity_> has 32 items for 64 lasers"},
      {db_xml(good_points() + list("maxIntensity_", 64, [](int) { return "300"; })),
       "<maxIntensity_> item 0 is not in 0..255"},
  };
  for (const auto& [text, message] : cases) {
    EXPECT_THAT(error_of(text),
                AllOf(testing::StartsWith("car/db.xml: "), HasSubstr(message), HasSubstr("use the db.xml that came")));
  }
}

TEST(Calibration, of_another_model_is_refused) {
  const auto hdl64 = parse_db_xml(db_xml(good_points()), "db.xml");
  ASSERT_TRUE(hdl64);
  const auto fitted = fit_to_model(*hdl64, LidarModel::hdl32e, "db.xml");
  ASSERT_FALSE(fitted);
  EXPECT_THAT(fitted.error().message, HasSubstr("has 64 lasers, but a HDL-32E has 32"));
  const auto coarse = parse_db_xml(db_xml(good_points(), "<distLSB_>0.4</distLSB_>"), "db.xml");
  ASSERT_TRUE(coarse);
  EXPECT_THAT(fit_to_model(*coarse, LidarModel::hdl64e_s2, "db.xml").error().message, HasSubstr("steps of 2 mm"));
}

TEST(Calibration, of_a_smaller_head_may_carry_disabled_lasers_at_the_end) {
  const std::string enabled = list("enabled_", 64, [](int i) { return i < 32 ? "1" : "0"; });
  const auto calibration = parse_db_xml(db_xml(good_points() + enabled), "db.xml");
  ASSERT_TRUE(calibration);
  const auto fitted = fit_to_model(*calibration, LidarModel::hdl32e, "db.xml");
  ASSERT_TRUE(fitted) << fitted.error().message;
  EXPECT_EQ(fitted->lasers.size(), 32U);
}

TEST(Calibration, is_built_in_for_the_models_whose_heads_are_alike) {
  EXPECT_EQ(calibration_for(LidarModel::hdl32e, "")->lasers.size(), 32U);
  EXPECT_NEAR(calibration_for(LidarModel::vlp16, "")->lasers[15].elevation_rad, rad_from_deg(15), 1e-9);
  const auto missing = calibration_for(LidarModel::hdl64e_s2, "");
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().message, HasSubstr("a HDL-64E S2 needs the calibration of its own lasers"));
}

TEST(Calibration, is_loaded_from_a_file_and_a_missing_one_is_named) {
  const TempFile file(db_xml(good_points()));
  EXPECT_TRUE(calibration_for(LidarModel::hdl64e_s2, file.path()).has_value());
  EXPECT_THAT(load_db_xml("/nowhere/db.xml").error().message,
              AllOf(HasSubstr("/nowhere/db.xml"), HasSubstr("No such file")));
}

TEST(Calibration, of_a_real_hdl64e_is_read) {
  const auto maybe_path = recording("velodyne/hdl64e_s2.1_sztaki_db.xml");
  if (!maybe_path) return;
  const auto calibration = calibration_for(LidarModel::hdl64e_s2, *maybe_path);
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_NEAR(calibration->lasers[2].distance_y_m, 1.5456783, 1e-6);
  EXPECT_EQ(std::ranges::count(calibration->lasers, 255.0, &LaserCalibration::max_intensity), 62);
}

}  // namespace
}  // namespace roadvec
