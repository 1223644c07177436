#include "tools/import/head_fit.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <complex>
#include <limits>
#include <string>

#include "core/base/angle.h"
#include "tools/recording/output_file.h"

namespace roadvec {
namespace {

constexpr double kHorizontalOffset_m = 0.026;  ///< of every HDL-64E, to either side [VelodyneHDL64]
constexpr double kStep_m = 0.002;              ///< of a distance [VelodyneHDL64]
constexpr double kCell_rad = kTwoPi / kEncoderCells;
/// Of the bearing from laser to laser; neighbours of one laser fall back by rounding alone, 0.02 degrees at 2.5 m.
constexpr double kFallsBack_rad = rad_from_deg(3.0);
/// A laser that has seen less than this is not over.
constexpr double kLeastTurn_rad = rad_from_deg(30.0);
/// Rotations of real heads lie within 10 degrees of their mean, so those of two lasers within 222 cells.
constexpr int kFarthestShift_cells = 250;
constexpr double kFar_m = 5, kWeightEnds_m = 30;
constexpr std::size_t kFewestPoints = 100;  ///< of a laser in all revolutions

double bearing_rad(const KittiPoint& point) {
  const double b_rad = std::atan2(static_cast<double>(point.y_m), static_cast<double>(point.x_m));
  return b_rad < 0 ? b_rad + kTwoPi : b_rad;
}
double rho_m(const KittiPoint& point) {
  return std::hypot(static_cast<double>(point.x_m), static_cast<double>(point.y_m));
}
/// Along the beam as seen from above: the laser sits beside the axis.
double flat_range_m(double rho_m_) {
  return std::sqrt(std::max(0.0, rho_m_ * rho_m_ - kHorizontalOffset_m * kHorizontalOffset_m));
}
/// Clockwise, of the beam, in cells.
double beam_cells(const KittiPoint& point, double horizontal_offset_m) {
  return (std::asin(std::clamp(horizontal_offset_m / rho_m(point), -1.0, 1.0)) - bearing_rad(point)) / kCell_rad;
}
int wrapped(long cell) { return static_cast<int>(((cell % kEncoderCells) + kEncoderCells) % kEncoderCells); }

/// A straight line through (d, z), each point once.
struct LineFit {
  double count = 0, d = 0, z = 0, dd = 0, dz = 0;
  void add(double x, double y) {
    ++count;
    d += x;
    z += y;
    dd += x * x;
    dz += x * y;
  }
  [[nodiscard]] double slope() const { return (count * dz - d * z) / (count * dd - d * d); }
  [[nodiscard]] double at_zero() const { return (z - slope() * d) / count; }
};

template <class Each>
void each_point(std::span<const LaserPoints> revolutions, std::size_t laser, Each&& each) {
  for (const LaserPoints& revolution : revolutions) {
    for (const KittiPoint& point : revolution[laser]) each(point);
  }
}

/// Elevation and vertical offset.
bool fit_line(std::span<const LaserPoints> revolutions, std::size_t laser, LaserGeometry& geometry) {
  LineFit line;
  each_point(revolutions, laser,
             [&](const KittiPoint& point) { line.add(flat_range_m(rho_m(point)), static_cast<double>(point.z_m)); });
  const double slope = line.slope();
  if (line.count < kFewestPoints || !std::isfinite(slope) || std::abs(slope) > 1) return false;
  geometry.cos_elevation = 1 / std::sqrt(1 + slope * slope);
  geometry.sin_elevation = slope * geometry.cos_elevation;
  geometry.vertical_offset_m = line.at_zero();
  return true;
}

/// How well the bearings fall onto cells if the laser sits so far to the side: the longer, the better; and where in a
/// cell.
std::complex<double> onto_cells(std::span<const LaserPoints> revolutions, std::size_t laser, double offset_m) {
  std::complex<double> sum = 0;
  each_point(revolutions, laser, [&](const KittiPoint& point) {
    // A millimetre of rounding is an angle of 1 / rho.
    const double weight = std::min(rho_m(point), kWeightEnds_m);
    sum += weight * weight * std::polar(1.0, kTwoPi * beam_cells(point, offset_m));
  });
  return sum;
}

/// Lasers sit to the left and to the right in turn. Which begins is asked of all together: one that sees nothing but
/// flat ground, always as far away, does not tell.
void fit_sides(std::span<const LaserPoints> revolutions, std::array<LaserGeometry, kHeadLasers>& lasers) {
  double best = -1;
  for (const double even_m : {kHorizontalOffset_m, -kHorizontalOffset_m}) {
    std::array<std::complex<double>, kHeadLasers> sums;
    double total = 0;
    for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
      sums[laser] = onto_cells(revolutions, laser, laser % 2 == 0 ? even_m : -even_m);
      total += std::abs(sums[laser]);
    }
    if (total <= best) continue;
    best = total;
    for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
      lasers[laser].horizontal_offset_m = laser % 2 == 0 ? even_m : -even_m;
      lasers[laser].rotation_cells = -std::arg(sums[laser]) / kTwoPi;
    }
  }
}

/// Where between two steps of 2 mm the distances lie.
void fit_distance(std::span<const LaserPoints> revolutions, std::size_t laser, LaserGeometry& geometry) {
  std::complex<double> sum = 0;
  each_point(revolutions, laser, [&](const KittiPoint& point) {
    sum += std::polar(1.0, kTwoPi * geometry.beam_of(point).range_m / kStep_m);
  });
  const double phase = std::arg(sum) / kTwoPi;
  geometry.distance_m = kStep_m * (phase < 0 ? phase + 1 : phase);
}

using Cells = std::bitset<kEncoderCells>;

Cells turned(const Cells& cells, int by) {
  const auto forward = static_cast<std::size_t>(wrapped(by));
  return cells << forward | cells >> (kEncoderCells - forward);
}

/// All lasers fire at the same readings, so a laser's firings lie in another's once its rotation is right. Readings are
/// two cells apart, or one where the head lags: the pattern repeats badly enough after 13 cells. Returns the worst
/// laser's share of firings in the other's.
double fit_rotations(std::span<const LaserPoints> revolutions, std::array<LaserGeometry, kHeadLasers>& lasers) {
  std::vector<std::array<Cells, kHeadLasers>> fired(revolutions.size());
  std::array<std::size_t, kHeadLasers> firing_counts{};
  for (std::size_t r = 0; r < revolutions.size(); ++r) {
    for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
      for (const KittiPoint& point : revolutions[r][laser]) {
        fired[r][laser].set(static_cast<std::size_t>(lasers[laser].beam_of(point).cell));
      }
      firing_counts[laser] += fired[r][laser].count();
    }
  }
  const auto fullest =
      static_cast<std::size_t>(std::max_element(firing_counts.begin(), firing_counts.end()) - firing_counts.begin());
  double worst = 1, mean_cells = 0;
  for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
    std::size_t most = 0;
    int best_shift = 0;
    for (int shift = -kFarthestShift_cells; shift <= kFarthestShift_cells; ++shift) {
      std::size_t shared = 0;
      for (const auto& cells : fired) shared += (turned(cells[laser], shift) & cells[fullest]).count();
      if (shared <= most) continue;
      most = shared;
      best_shift = shift;
    }
    lasers[laser].rotation_cells += best_shift;
    mean_cells += lasers[laser].rotation_cells / kHeadLasers;
    worst = std::min(worst, static_cast<double>(most) / static_cast<double>(firing_counts[laser]));
  }
  for (LaserGeometry& laser : lasers) laser.rotation_cells -= std::round(mean_cells);
  return worst;
}

/// The value that 95 % do not exceed.
double quantile95(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 95 / 100);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

void measure(std::span<const LaserPoints> revolutions, HeadFit& head) {
  std::vector<double> off_m, cells;
  for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
    each_point(revolutions, laser, [&](const KittiPoint& point) {
      const LaserGeometry::Beam beam = head.lasers[laser].beam_of(point);
      off_m.push_back(beam.off_the_line_m);
      if (beam.range_m > kFar_m) cells.push_back(std::abs(beam.cell_error));
    });
  }
  head.off_the_line_m = quantile95(off_m);
  head.cell_error = quantile95(cells);
}

double rounded(double value, double step) { return std::round(value / step) * step; }

}  // namespace

Expected<LaserPoints> split_lasers(std::span<const KittiPoint> points) {
  LaserPoints lasers;
  std::size_t laser = 0;
  double last_rad = 0, turned_rad = 0;
  for (const KittiPoint& point : points) {
    const double b_rad = bearing_rad(point);
    if (turned_rad > kLeastTurn_rad && b_rad < last_rad - kFallsBack_rad) {
      ++laser;
      turned_rad = 0;
    } else if (last_rad != 0) {
      turned_rad += wrap_rad(b_rad - last_rad);
    }
    last_rad = b_rad;
    if (laser < kHeadLasers) lasers[laser].push_back(point);
  }
  if (points.empty()) return fail("it is empty");
  if (laser + 1 != kHeadLasers) return fail(std::to_string(laser + 1) + " lasers in place of 64");
  return lasers;
}

LaserGeometry::Beam LaserGeometry::beam_of(const KittiPoint& point) const {
  const double flat_m = flat_range_m(rho_m(point));
  const double up_m = static_cast<double>(point.z_m) - vertical_offset_m;
  const double cells = beam_cells(point, horizontal_offset_m) + rotation_cells;
  Beam beam;
  beam.cell = wrapped(std::lround(cells));
  beam.cell_error = cells - std::round(cells);
  beam.range_m = flat_m * cos_elevation + up_m * sin_elevation;
  beam.off_the_line_m = std::abs(up_m * cos_elevation - flat_m * sin_elevation);
  return beam;
}

Expected<HeadFit> fit_head(std::span<const LaserPoints> revolutions) {
  HeadFit head;
  for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
    if (!fit_line(revolutions, laser, head.lasers[laser])) {
      return fail("laser " + std::to_string(laser) + " has too few points to be calibrated");
    }
    fit_distance(revolutions, laser, head.lasers[laser]);
  }
  fit_sides(revolutions, head.lasers);
  head.rotation_agreement = fit_rotations(revolutions, head.lasers);
  measure(revolutions, head);
  constexpr double kConeWidth_m = 0.002, kLargestCellError = 0.2, kLeastAgreement = 0.9;
  if (head.off_the_line_m > kConeWidth_m || head.cell_error > kLargestCellError ||
      head.rotation_agreement < kLeastAgreement) {
    return fail(
        print("95 %% of the points lie within %.4f m of their laser's cone and %.2f of an encoder cell, and the "
              "lasers agree on %.0f %% of the firings: not what an HDL-64E of KITTI gives",
              head.off_the_line_m, head.cell_error, 100 * head.rotation_agreement));
  }
  return head;
}

void mend_borders(LaserPoints& points, const HeadFit& head) {
  const auto fits_better = [&](const KittiPoint& point, std::size_t there, std::size_t here) {
    return head.lasers[there].beam_of(point).off_the_line_m < head.lasers[here].beam_of(point).off_the_line_m;
  };
  for (std::size_t lower = 1; lower < kHeadLasers; ++lower) {
    std::vector<KittiPoint>&above = points[lower - 1], &below = points[lower];
    while (!above.empty() && fits_better(above.back(), lower, lower - 1)) {
      below.insert(below.begin(), above.back());
      above.pop_back();
    }
    while (!below.empty() && fits_better(below.front(), lower - 1, lower)) {
      above.push_back(below.front());
      below.erase(below.begin());
    }
  }
}

Calibration calibration_of(const HeadFit& head) {
  Calibration calibration;
  calibration.distance_lsb_m = kStep_m;
  for (const LaserGeometry& geometry : head.lasers) {
    LaserCalibration laser;
    laser.elevation_rad =
        rad_from_deg(rounded(deg_from_rad(std::atan2(geometry.sin_elevation, geometry.cos_elevation)), 1e-4));
    laser.rotation_rad = rad_from_deg(rounded(deg_from_rad(geometry.rotation_cells * kCell_rad), 1e-4));
    laser.vertical_offset_m = rounded(geometry.vertical_offset_m, 1e-4);
    laser.horizontal_offset_m = geometry.horizontal_offset_m;
    laser.distance_m = rounded(geometry.distance_m, 1e-4);
    calibration.lasers.push_back(laser);
  }
  return calibration;
}

}  // namespace roadvec
