#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "drivers/velodyne/calibration.h"
#include "tools/import/kitti_files.h"

namespace roadvec {

inline constexpr std::size_t kHeadLasers = 64;
/// The encoder of the head reads 0.09 degrees [VelodyneHDL64].
inline constexpr int kEncoderCells = 4000, kCell_cdeg = 9;

/// The points of one revolution by laser, from top to bottom.
using LaserPoints = std::array<std::vector<KittiPoint>, kHeadLasers>;

/// Scans are written laser by laser, each laser from straight ahead round to the left, so that the bearing falls back
/// where a laser ends. Error: there are not 64 lasers.
[[nodiscard]] Expected<LaserPoints> split_lasers(std::span<const KittiPoint> points);

/// What has to be known of one laser to turn its points back into what the sensor measured.
struct LaserGeometry {
  double sin_elevation = 0, cos_elevation = 1;
  double vertical_offset_m = 0, horizontal_offset_m = 0;
  double rotation_cells = 0;
  double distance_m = 0;  ///< a distance is this and a whole number of 2 mm

  struct Beam {
    int cell = 0;               ///< of the encoder, [0, 4000)
    double cell_error = 0;      ///< how far from its middle, in cells
    double range_m = 0;         ///< along the beam
    double off_the_line_m = 0;  ///< how far the point lies from the cone that the laser sweeps
  };
  [[nodiscard]] Beam beam_of(const KittiPoint& point) const;
};

struct HeadFit {
  std::array<LaserGeometry, kHeadLasers> lasers{};
  double off_the_line_m = 0;      ///< of 95 % of the points
  double cell_error = 0;          ///< of 95 % of the points farther than 5 m, in encoder cells
  double rotation_agreement = 0;  ///< share of a laser's firings that another laser fired at too; the worst laser's
};

/// Finds the calibration that revolutions of one head were made with from their points alone: each laser's elevation
/// and height by a line (z = rho tan V + vo), the side of its horizontal offset by which way round the bearings fall
/// onto the encoder's cells, its rotation by when it fired: all lasers fire at the same readings of the encoder. Only
/// differences of rotations show; their mean is taken to be 0 to a whole cell. Error: the points are not an HDL-64E's.
[[nodiscard]] Expected<HeadFit> fit_head(std::span<const LaserPoints> revolutions);

/// Where bearings are a hair beyond straight ahead, split_lasers() cuts a point too early or too late: moves points at
/// the borders to the laser on whose cone they lie.
void mend_borders(LaserPoints& points, const HeadFit& head);

/// As Velodyne would write it, with the steps of its file.
[[nodiscard]] Calibration calibration_of(const HeadFit& head);

}  // namespace roadvec
