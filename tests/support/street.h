#pragma once

#include <cmath>
#include <random>

#include "core/base/angle.h"
#include "core/sensor/lidar.h"

namespace roadvec::test {

/// A street along x seen by a made-up sensor 1.73 m above the rear axle: kerbs of `kerb_m` at y = +-half_width_m, a
/// wall at y = wall_y_m. Returns are in the lidar frame, which here is the vehicle frame moved up by kEye_m.
struct Street {
  static constexpr double kEye_m = 1.73;
  double half_width_m = 4.0;
  double kerb_m = 0.12;
  double wall_y_m = 8.0;
  double slope = 0.0;  ///< of the whole street along x
  double noise_m = 0.0;

  /// What a car at (x_m, y_m, heading) sees: 64 rings, `columns` firings.
  [[nodiscard]] Sweep sweep_from(double x_m, double y_m, double heading_rad, unsigned seed = 0,
                                 int columns = 1800) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 1);
    Sweep sweep;
    sweep.complete = true;
    sweep.start = {0};
    sweep.end = {100'000'000};
    for (int column = 0; column < columns; ++column) {
      const double azimuth = kTwoPi * column / columns;
      for (int laser = 0; laser < 64; ++laser) {
        const double elevation = rad_from_deg(2.0 - 26.8 * laser / 63.0);
        const double range = range_along(x_m, y_m, heading_rad - azimuth, elevation) + noise_m * noise(random);
        if (range <= 0 || range > 60) continue;
        const double flat = range * std::cos(elevation);
        sweep.returns.push_back({.x_m = static_cast<float>(flat * std::cos(azimuth)),
                                 .y_m = static_cast<float>(-flat * std::sin(azimuth)),
                                 .z_m = static_cast<float>(range * std::sin(elevation)),
                                 .azimuth_rad = static_cast<float>(azimuth),
                                 .time_ns = static_cast<std::uint32_t>(1e8 * column / columns),
                                 .laser = static_cast<std::uint8_t>(laser),
                                 .intensity = 50});
      }
    }
    return sweep;
  }

 private:
  /// Nearest of: road, kerb faces, sidewalks, wall. The car stands level on the road at x = 0 of the slope.
  [[nodiscard]] double range_along(double x_m, double y_m, double bearing_rad, double elevation_rad) const {
    const double dx = std::cos(bearing_rad) * std::cos(elevation_rad),
                 dy = std::sin(bearing_rad) * std::cos(elevation_rad);
    const double dz = std::sin(elevation_rad);
    double best = 1e9;
    const auto consider = [&](double t, double low_m, double high_m, double low_y, double high_y) {
      if (t <= 0.5 || t >= best) return;
      const double z = kEye_m + t * dz - slope * t * dx, y = y_m + t * dy;
      if (z >= low_m - 1e-9 && z <= high_m + 1e-9 && y >= low_y - 1e-9 && y <= high_y + 1e-9) best = t;
    };
    static_cast<void>(x_m);
    const double fall = dz - slope * dx;
    if (fall < 0) {
      consider(-kEye_m / fall, 0, 0, -half_width_m, half_width_m);
      consider((kerb_m - kEye_m) / fall, kerb_m, kerb_m, half_width_m, 1e9);
      consider((kerb_m - kEye_m) / fall, kerb_m, kerb_m, -1e9, -half_width_m);
    }
    if (dy > 0) {
      consider((half_width_m - y_m) / dy, 0, kerb_m, half_width_m, half_width_m);
      consider((wall_y_m - y_m) / dy, kerb_m, 4.0, wall_y_m, wall_y_m);
    }
    if (dy < 0) consider((-half_width_m - y_m) / dy, 0, kerb_m, -half_width_m, -half_width_m);
    return best < 1e8 ? best : -1;
  }
};

}  // namespace roadvec::test
