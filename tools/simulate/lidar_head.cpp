#include "tools/simulate/lidar_head.h"

#include <array>
#include <cmath>

#include "core/base/angle.h"
#include "drivers/velodyne/packet.h"
#include "tools/simulate/output_file.h"

namespace roadvec {
namespace {

constexpr int kBankLasers = 32;

/// A number in [-1, 1] that differs from laser to laser and never from run to run.
double wiggle(int laser, int what) {
  return std::remainder(0.618034 * laser * (2 * what + 1) + 0.37 * what, 1.0) * 2.0;
}

double rounded(double value, double step) { return std::round(value / step) * step; }

LaserCalibration hdl64_laser(int laser) {
  const int bank = laser / kBankLasers;
  // Neighbours in time are far apart in elevation, as in real heads; 13 and 32 have no common divisor.
  const int row = (laser % kBankLasers) * 13 % kBankLasers;
  const double step_deg = bank == 0 ? 1.0 / 3.0 : 0.5;
  const double top_deg = bank == 0 ? 2.0 : -8.83;
  const std::array<double, 4> column_deg{-3.4, 1.2, -1.1, 3.5};
  LaserCalibration calibration;
  calibration.elevation_rad = rad_from_deg(rounded(top_deg - step_deg * row + 0.03 * wiggle(laser, 0), 1e-4));
  calibration.rotation_rad =
      rad_from_deg(rounded(column_deg[static_cast<std::size_t>(row % 4)] + 0.3 * wiggle(laser, 1), 1e-4));
  calibration.distance_m = rounded(1.2 + 0.08 * wiggle(laser, 2), 1e-4);
  calibration.distance_x_m = calibration.distance_y_m = calibration.distance_m;
  calibration.vertical_offset_m = rounded((bank == 0 ? 0.212 : 0.160) - 0.0013 * row, 1e-4);
  calibration.horizontal_offset_m = laser % 2 == 0 ? 0.026 : -0.026;
  calibration.focal_distance_m = 12.0;
  return calibration;
}

std::string item_list(const char* name, int class_id, std::size_t count, const char* value) {
  std::string text = print(
      "\t<%s class_id=\"%d\" tracking_level=\"0\" version=\"0\">\n\t\t<count>%zu</count>\n"
      "\t\t<item_version>0</item_version>\n",
      name, class_id, count);
  for (std::size_t i = 0; i < count; ++i) text += print("\t\t<item>%s</item>\n", value);
  return text + print("\t</%s>\n", name);
}

}  // namespace

Expected<LidarHead> make_lidar_head(const std::string& model_name) {
  const auto model = lidar_model_from(model_name);
  if (!model) return tl::unexpected(model.error());
  LidarHead head;
  head.model = *model;
  if (auto built_in = built_in_calibration(*model)) {
    head.calibration = *std::move(built_in);
    return head;
  }
  const ModelFacts& facts = facts_of(*model);
  if (facts.laser_count != 2 * kBankLasers) return fail("no calibration can be made up for a " + model_name);
  head.calibration.distance_lsb_m = facts.distance_lsb_m;
  for (int laser = 0; laser < facts.laser_count; ++laser) head.calibration.lasers.push_back(hdl64_laser(laser));
  return head;
}

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
