#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/simulate/scene_world.h"

namespace roadvec {

struct CarSpec {
  double wheelbase_m = 2.71, track_m = 1.55, steering_ratio = 15.0;
  std::vector<Waypoint> route;  ///< the line it follows; empty: the first road's centre line
  bool route_closed = false;
  double lane_m = -1.75;                    ///< of the rear axle beside that line, left positive
  double start_m = 0;                       ///< station of the rear axle at the start
  double distance_m = 100;                  ///< driven along the centre line until the car stops again
  double wait_s = 1.0;                      ///< at standstill before and after
  double speed_mps = 8.0;                   ///< on straights
  double acceleration_mps2 = 2.0;           ///< speeding up and braking, at most
  double jerk_mps3 = 4.0;                   ///< of that, at most
  double side_acceleration_mps2 = 2;        ///< in curves, at most
  double understeer_rad_per_mps2 = 0.0025;  ///< steering needed beyond geometry, by side acceleration: rad per m/s^2
  double rear_slip_rad_per_mps2 = 0.007;    ///< slip angle of the rear axle, likewise
  double pitch_deg_per_mps2 = 0.3;          ///< of the body on its springs, by braking: degrees per m/s^2
  double roll_deg_per_mps2 = 0.4;           ///< outwards, by side acceleration
};

/// Which echoes of a firing the head sends.
enum class ReturnMode : std::uint8_t { strongest, last, dual };

struct LidarSpec {
  std::string model = "HDL-64E S2";
  double x_m = 0.76, y_m = 0, z_m = 1.73;
  double roll_deg = 0, pitch_deg = 0, yaw_deg = 0;  ///< R = Rz Ry Rx
  double rotation_hz = 10;
  double range_m = 120;
  ReturnMode return_mode = ReturnMode::strongest;
  double wet = 0;  ///< share of the ground that is under a film of water
};

/// What the sensors get wrong. Truth files are free of all of it.
struct ErrorSpec {
  double steering_offset_deg = 0.6;    ///< added, at the steering wheel
  double wheel_speed_scale = 1.01;     ///< measured over true
  double wheel_radius_spread = 0.003;  ///< sigma of each wheel's own share of it
  double steering_step_deg = 0.1;      ///< of the CAN signal, at the steering wheel
  double wheel_speed_step_kmph = 0.01;
  double can_latency_ms = 10;       ///< from what a frame tells to its arrival
  double can_jitter_ms = 1;         ///< sigma of it
  double gyro_bias_degps = 0.05;    ///< yaw rate
  double gyro_noise_radps = 0.002;  ///< sigma of a sample
  double acceleration_noise_mps2 = 0.03;
  double compass_wander_deg = 1.5;     ///< sigma of the heading's slow error
  double compass_wander_s = 60.0;      ///< its correlation time
  double compass_soft_iron_deg = 1.0;  ///< amplitude of the error that comes back twice in a turn
  double range_noise_m = 0.02;         ///< sigma of a strong echo; doubled in one that is just heard
  double laser_bias_m = 0.015;         ///< each laser's constant range error, at most
  double laser_elevation_deg = 0.04;   ///< sigma of what the calibration has each laser look too high or low
  double packet_loss = 0;              ///< share of LiDAR packets that never arrive
  double packet_reordering = 0;        ///< share that arrive after the one behind them
  double arrival_jitter_us = 20;       ///< sigma of a LiDAR packet's delay
};

struct AnchorSpec {
  double latitude_deg = 49.0, longitude_deg = 8.4, height_m = 112.0;
};

/// A world, a car in it and its sensors, as a scene file says it. Scene frame: x east, y north, metres.
struct Scene {
  std::string description;
  std::int64_t start_ns = 0;  ///< UNIX time of the drive's first instant
  std::vector<RoadSpec> roads;
  std::vector<IslandSpec> islands;
  std::vector<HillSpec> hills;
  std::vector<MoverSpec> movers;
  double slope_percent = 0, slope_heading_deg = 0;  ///< of all the land, besides the hills
  double corner_radius_m = 5.0;                     ///< of the kerb where roads meet
  std::optional<double> maybe_change_s;             ///< when `before` ends and `after` begins
  double reflectivity[kMaterialCount] = {0.15, 0.30, 0.25, 0.45, 0.60, 0.25, 0.50,
                                         0.45, 0.25, 0.45, 0.10, 0.60, 0.40, 0.40};
  double roughness_m[kMaterialCount] = {0.003, 0, 0.002, 0, 0, 0.01, 0, 0.03, 0.01, 0, 0, 0, 0, 0};  ///< at most
  CarSpec car;
  LidarSpec lidar;
  ErrorSpec errors;
  AnchorSpec anchor;
};

}  // namespace roadvec
