#include "tools/simulate/lidar_head.h"

#include <array>
#include <cmath>

#include "core/base/angle.h"
#include "drivers/velodyne/packet.h"
#include "tools/simulate/random.h"

namespace roadvec {
namespace {

constexpr int kBankLasers = 32;

/// A number in [-1, 1) that differs from laser to laser without a pattern, and never from run to run.
double wiggle(int laser, int what) {
  return 2 * Random(static_cast<std::uint64_t>(laser), static_cast<std::uint64_t>(what)).uniform() - 1;
}

double rounded(double value, double step) { return std::round(value / step) * step; }

/// Spread as in the tables of real heads, an S2.1 and an S3: each laser is bent by hand.
LaserCalibration hdl64_laser(int laser, bool corrects_intensity) {
  const int bank = laser / kBankLasers;
  // Neighbours in time are far apart in elevation, as in real heads; 13 and 32 have no common divisor.
  const int row = (laser % kBankLasers) * 13 % kBankLasers;
  const double step_deg = bank == 0 ? 1.0 / 3.0 : 0.5;
  const double top_deg = bank == 0 ? 2.0 : -8.83;
  const std::array<double, 4> column_deg =
      bank == 0 ? std::array{-4.4, 2.2, -0.9, 5.6} : std::array{-7.2, 2.6, -1.5, 8.4};
  const double elevation_deg = top_deg - step_deg * row + (bank == 0 ? 0.06 : 0.17) * wiggle(laser, 0);
  LaserCalibration calibration;
  calibration.elevation_rad = rad_from_deg(rounded(elevation_deg, 1e-4));
  calibration.rotation_rad =
      rad_from_deg(rounded(column_deg[static_cast<std::size_t>(row % 4)] + 0.3 * wiggle(laser, 1), 1e-4));
  calibration.distance_m = rounded(1.23 + 0.10 * wiggle(laser, 2), 1e-4);
  calibration.distance_x_m = rounded(calibration.distance_m + 0.027 + 0.025 * wiggle(laser, 3), 1e-4);
  calibration.distance_y_m = rounded(calibration.distance_m + 0.024 + 0.035 * wiggle(laser, 4), 1e-4);
  // The lower a beam looks, the higher up its laser sits.
  calibration.vertical_offset_m =
      rounded(bank == 0 ? 0.2066 - 0.00126 * elevation_deg : 0.1333 - 0.00119 * elevation_deg, 1e-4);
  calibration.horizontal_offset_m = laser % 2 == 0 ? 0.026 : -0.026;
  calibration.focal_distance_m = rounded((bank == 0 ? 17.0 : 6.0) + 5.0 * wiggle(laser, 5), 1e-2);
  calibration.focal_slope = corrects_intensity ? rounded(1.15 + 0.5 * wiggle(laser, 6), 1e-1) : 0;
  return calibration;
}

}  // namespace

/// An HDL-64E's beam is round; those of the later heads widen twice as much along the scan as across it. An HDL-32E is
/// taken to be like them. [VelodyneHDL64ES3], [VelodyneVLS128, p. 115]
BeamShape beam_shape(LidarModel model) {
  const bool round = model == LidarModel::hdl64e_s2 || model == LidarModel::hdl64e_s3;
  return round ? BeamShape{1.0e-3, 1.0e-3, 6e-3} : BeamShape{1.5e-3, 0.75e-3, 6e-3};
}

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
  for (int laser = 0; laser < facts.laser_count; ++laser) {
    head.calibration.lasers.push_back(hdl64_laser(laser, *model == LidarModel::hdl64e_s3));
  }
  return head;
}

}  // namespace roadvec
