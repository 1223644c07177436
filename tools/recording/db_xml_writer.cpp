#include "tools/recording/db_xml_writer.h"

#include "core/base/angle.h"
#include "tools/recording/output_file.h"

namespace roadvec {
namespace {

std::string item_list(const char* name, int class_id, std::size_t count, const char* value) {
  std::string text = print(
      "\t<%s class_id=\"%d\" tracking_level=\"0\" version=\"0\">\n\t\t<count>%zu</count>\n"
      "\t\t<item_version>0</item_version>\n",
      name, class_id, count);
  for (std::size_t i = 0; i < count; ++i) text += print("\t\t<item>%s</item>\n", value);
  return text + print("\t</%s>\n", name);
}

}  // namespace

std::string db_xml(const Calibration& calibration) {
  const std::size_t count = calibration.lasers.size();
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\" ?>\n<!DOCTYPE boost_serialization>\n"
      "<boost_serialization signature=\"serialization::archive\" version=\"4\">\n"
      "<DB class_id=\"0\" tracking_level=\"1\" version=\"0\" object_id=\"_0\">\n";
  text += print("\t<distLSB_>%.1f</distLSB_>\n", calibration.distance_lsb_m.value_or(0.002) * 100);
  text += item_list("enabled_", 5, count, "1");
  text += item_list("minIntensity_", 6, count, "0");
  text += item_list("maxIntensity_", 6, count, "255");
  text += print(
      "\t<points_ class_id=\"7\" tracking_level=\"0\" version=\"0\">\n\t\t<count>%zu</count>\n"
      "\t\t<item_version>0</item_version>\n",
      count);
  for (std::size_t i = 0; i < count; ++i) {
    const LaserCalibration& laser = calibration.lasers[i];
    text += i == 0 ? "\t\t<item class_id=\"8\" tracking_level=\"0\" version=\"0\">\n" : "\t\t<item>\n";
    text += i == 0 ? "\t\t\t<px class_id=\"9\" tracking_level=\"1\" version=\"1\" object_id=\"_1\">\n"
                   : print("\t\t\t<px class_id_reference=\"9\" object_id=\"_%zu\">\n", i + 1);
    const auto element = [&](const char* name, int decimals, double value) {
      text += print("\t\t\t\t<%s>%.*f</%s>\n", name, decimals, value, name);
    };
    text += print("\t\t\t\t<id_>%zu</id_>\n", i);
    element("rotCorrection_", 4, deg_from_rad(laser.rotation_rad));
    element("vertCorrection_", 4, deg_from_rad(laser.elevation_rad));
    element("distCorrection_", 2, laser.distance_m * 100);
    element("distCorrectionX_", 2, laser.distance_x_m * 100);
    element("distCorrectionY_", 2, laser.distance_y_m * 100);
    element("vertOffsetCorrection_", 2, laser.vertical_offset_m * 100);
    element("horizOffsetCorrection_", 2, laser.horizontal_offset_m * 100);
    element("focalDistance_", 0, laser.focal_distance_m * 100);
    element("focalSlope_", 1, laser.focal_slope);
    text += "\t\t\t</px>\n\t\t</item>\n";
  }
  return text + "\t</points_>\n</DB>\n</boost_serialization>\n";
}

}  // namespace roadvec
