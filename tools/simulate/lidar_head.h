#pragma once

#include <cstdint>
#include <string>

#include "drivers/velodyne/calibration.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// What leaves the lens: how the beam widens, and its radius there.
struct BeamShape {
  double half_width_rad = 0, half_height_rad = 0, exit_radius_m = 0;
};
[[nodiscard]] BeamShape beam_shape(LidarModel model);

/// The sensor of a scene: its model and the calibration that came with it.
struct LidarHead {
  LidarModel model = LidarModel::hdl64e_s2;
  Calibration calibration;
};

/// The built-in angles of the model; for an HDL-64E a factory calibration made up like those of real heads: two banks
/// in steps of about 1/3 and 1/2 degree, fired far apart from each other, four columns of lasers turned against each
/// other, a distance correction above a metre that changes near the head, and in an S3 a correction of intensity.
[[nodiscard]] Expected<LidarHead> make_lidar_head(const std::string& model_name);

}  // namespace roadvec
