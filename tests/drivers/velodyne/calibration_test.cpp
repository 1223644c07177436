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
  EXPECT_THAT(load_calibration("/nowhere/db.xml").error().message,
              AllOf(HasSubstr("/nowhere/db.xml"), HasSubstr("No such file")));
}

std::string yaml_laser(int id, const std::string& more = "") {
  return "- {laser_id: " + std::to_string(id) + ", rot_correction: " + std::to_string(id * 0.001) +
         ", vert_correction: -0.1, dist_correction: 1.3, dist_correction_x: 1.31, dist_correction_y: 1.32, "
         "vert_offset_correction: 0.2, horiz_offset_correction: 0.026, focal_distance: 12.0, focal_slope: 1.4" +
         more + "}\n";
}
std::string yaml(int laser_count, const std::string& head = "distance_resolution: 0.002\n",
                 const std::string& more = "") {
  std::string text = head + "lasers:\n";
  for (int i = laser_count - 1; i >= 0; --i) text += yaml_laser(i, more);
  return text + "num_lasers: " + std::to_string(laser_count) + "\nstatus: {Model: S3, list: [1, {a: b}]}\n";
}

TEST(CalibrationYaml, is_read_in_metres_and_radians_and_puts_lasers_by_their_id) {
  const auto calibration = parse_calibration_yaml(yaml(64), "ros.yaml");
  ASSERT_TRUE(calibration) << calibration.error().message;
  ASSERT_EQ(calibration->lasers.size(), 64U);
  EXPECT_EQ(calibration->distance_lsb_m, 0.002);
  const LaserCalibration& l = calibration->lasers[20];
  EXPECT_DOUBLE_EQ(l.rotation_rad, 0.020);
  EXPECT_DOUBLE_EQ(l.elevation_rad, -0.1);
  EXPECT_DOUBLE_EQ(l.distance_m, 1.3);
  EXPECT_DOUBLE_EQ(l.distance_x_m, 1.31);
  EXPECT_DOUBLE_EQ(l.distance_y_m, 1.32);
  EXPECT_DOUBLE_EQ(l.vertical_offset_m, 0.2);
  EXPECT_DOUBLE_EQ(l.horizontal_offset_m, 0.026);
  EXPECT_DOUBLE_EQ(l.focal_distance_m, 12.0);
  EXPECT_DOUBLE_EQ(l.focal_slope, 1.4);
  EXPECT_EQ(l.min_intensity, 0);
  EXPECT_EQ(l.max_intensity, 255);
}

TEST(CalibrationYaml, has_no_near_correction_when_it_says_so) {
  const auto with = parse_calibration_yaml(yaml(16, "", ", two_pt_correction_available: true"), "ros.yaml");
  const auto without = parse_calibration_yaml(yaml(16, "", ", two_pt_correction_available: false"), "ros.yaml");
  ASSERT_TRUE(with && without);
  EXPECT_EQ(with->lasers[0].distance_x_m, 1.31);
  EXPECT_EQ(without->lasers[0].distance_x_m, 0);
}

TEST(CalibrationYaml, with_the_converters_wrong_resolution_leaves_the_step_to_the_model) {
  const auto calibration = parse_calibration_yaml(yaml(64, "distance_resolution: 0.2\n"), "ros.yaml");
  ASSERT_TRUE(calibration);
  EXPECT_FALSE(calibration->distance_lsb_m.has_value());
  const auto coarse = parse_calibration_yaml(yaml(64, "distance_resolution: 0.004\n"), "ros.yaml");
  ASSERT_TRUE(coarse);
  EXPECT_FALSE(fit_to_model(*coarse, LidarModel::hdl64e_s3, "ros.yaml"));
}

TEST(CalibrationYaml, that_is_wrong_names_file_place_and_remedy) {
  const std::pair<std::string, const char*> cases[] = {
      {"", "is not a YAML mapping"},
      {"- 1", "is not a YAML mapping"},
      {"lasers: [", "not YAML"},
      {"num_lasers: 3", "has no lasers"},
      {"lasers: 7", "line 1: lasers is not a list"},
      {"lasers:\n- 7", "line 2: a laser is not a mapping"},
      {"lasers:\n- {[a]: 7}", "line 2: a key is expected"},
      {"lasers:\n- {laser_id: 0, rot_correction: 0}", "line 2: the laser lacks"},
      {"lasers:\n- {laser_id: 0, rot_correction: x, vert_correction: 0}", "rot_correction is not a number"},
      {"lasers:\n- {laser_id: 0, rot_correction: .nan, vert_correction: 0}", "rot_correction is not a number"},
      {"lasers:\n- {laser_id: 0, rot_correction: 0, vert_correction: -7}", "an angle is out of range (radians"},
      {"lasers:\n- {laser_id: 1, rot_correction: 0, vert_correction: 0}", "laser_id 0 is missing"},
      {"lasers:\n- {laser_id: 0, two_pt_correction_available: 2}", "neither true nor false"},
      {"distance_resolution: 2\nlasers: []", "not in (0, 0.01] metres"},
      {yaml(129), "more than 128 lasers"},
  };
  for (const auto& [text, message] : cases) {
    const auto calibration = parse_calibration_yaml(text, "car/ros.yaml");
    ASSERT_FALSE(calibration) << message;
    EXPECT_THAT(calibration.error().message,
                AllOf(testing::StartsWith("car/ros.yaml: "), HasSubstr(message), HasSubstr("use the YAML file")));
  }
}

TEST(CalibrationFile, is_taken_for_xml_or_yaml_by_what_it_holds) {
  const TempFile xml(db_xml(good_points())), ros(yaml(64)), neither("<lasers");
  EXPECT_TRUE(calibration_for(LidarModel::hdl64e_s3, xml.path()).has_value());
  EXPECT_TRUE(calibration_for(LidarModel::hdl64e_s3, ros.path()).has_value());
  EXPECT_THAT(load_calibration(neither.path()).error().message, HasSubstr("not XML"));
}

// But for the intensities: ROS' converter left out the zeros of this db.xml and moved the others up.
TEST(CalibrationFile, of_a_real_head_is_the_same_in_xml_and_yaml) {
  const auto maybe_xml = recording("velodyne/hdl64e_s2.1_sztaki_db.xml");
  const auto maybe_yaml = recording("velodyne/hdl64e_s2.1_sztaki.yaml");
  const auto maybe_s3 = recording("velodyne/hdl64e_s3_xiesc.yaml");
  const auto maybe_vlp16 = recording("velodyne/vlp16.yaml");
  if (!maybe_xml || !maybe_yaml || !maybe_s3 || !maybe_vlp16) return;
  const auto xml = calibration_for(LidarModel::hdl64e_s2, *maybe_xml);
  const auto ros = calibration_for(LidarModel::hdl64e_s2, *maybe_yaml);
  ASSERT_TRUE(xml && ros);
  for (std::size_t i = 0; i < 64; ++i) {
    EXPECT_NEAR(xml->lasers[i].rotation_rad, ros->lasers[i].rotation_rad, 1e-7);
    EXPECT_NEAR(xml->lasers[i].elevation_rad, ros->lasers[i].elevation_rad, 1e-7);
    EXPECT_NEAR(xml->lasers[i].distance_m, ros->lasers[i].distance_m, 1e-6);
    EXPECT_NEAR(xml->lasers[i].distance_y_m, ros->lasers[i].distance_y_m, 1e-6);
    EXPECT_NEAR(xml->lasers[i].focal_distance_m, ros->lasers[i].focal_distance_m, 1e-6);
  }
  EXPECT_TRUE(calibration_for(LidarModel::hdl64e_s3, *maybe_s3).has_value());
  const auto vlp16 = calibration_for(LidarModel::vlp16, *maybe_vlp16);
  ASSERT_TRUE(vlp16);
  for (std::size_t i = 0; i < 16; ++i)
    EXPECT_NEAR(vlp16->lasers[i].elevation_rad, built_in_calibration(LidarModel::vlp16)->lasers[i].elevation_rad, 1e-6);
}

TEST(CalibrationFile, of_a_real_vlp32c_holds_the_angles_that_are_built_in) {
  const auto maybe_path = recording("velodyne/vlp32c_db.xml");
  if (!maybe_path) return;
  const auto file = calibration_for(LidarModel::vlp32c, *maybe_path);
  ASSERT_TRUE(file) << file.error().message;
  const auto built_in = built_in_calibration(LidarModel::vlp32c);
  for (std::size_t i = 0; i < 32; ++i) {
    EXPECT_NEAR(file->lasers[i].elevation_rad, built_in->lasers[i].elevation_rad, rad_from_deg(0.002)) << i;
    EXPECT_NEAR(file->lasers[i].rotation_rad, built_in->lasers[i].rotation_rad, rad_from_deg(0.002)) << i;
  }
}

TEST(Calibration, that_a_head_streams_is_for_the_hdl64e_alone) {
  const auto streamed = calibration_for(LidarModel::hdl64e_s3, kStreamedCalibration);
  ASSERT_TRUE(streamed);
  EXPECT_TRUE(streamed->streamed);
  EXPECT_THAT(calibration_for(LidarModel::vlp16, kStreamedCalibration).error().message,
              HasSubstr("a VLP-16 does not stream its calibration"));
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
