#include "tools/simulate/lidar_head.h"

#include <array>
#include <cmath>

#include "core/base/angle.h"
#include "drivers/velodyne/packet.h"

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

}  // namespace roadvec
