#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace roadvec {

/// Side of the road, seen in the direction of growing station.
enum class Side : std::uint8_t { left, right };

/// What a surface is made of: decides how much light comes back.
enum class Material : std::uint8_t { road, kerb, sidewalk, wall, pole, tree, car };
inline constexpr int kMaterialCount = 7;

/// Waypoint of the centre line, rounded with an arc.
struct Waypoint {
  Eigen::Vector2d position_m;
  double radius_m = 0;
};

/// Opening in a kerb: a driveway (level with the road through the sidewalk) or the mouth of a side street.
struct KerbGap {
  Side side = Side::right;
  double at_m = 0;      ///< station of its middle
  double width_m = 4;   ///< between the two kerbs
  double radius_m = 0;  ///< rounding of the kerb's two corners
};

struct RoadSpec {
  std::vector<Waypoint> waypoints;
  bool closed = false;
  double width_m = 7.0;
  double kerb_height_m = 0.12;
  double sidewalk_m = 20.0;  ///< how far the raised ground reaches from the kerb
  std::vector<KerbGap> gaps;
};

/// Things along the road repeat from one station to another and stand clear of the kerb's gaps.
struct RowSpec {
  Side side = Side::right;
  double from_m = 0;
  std::optional<double> maybe_to_m;  ///< absent: the road's end
};

/// House fronts or a wall: beside the road, or an explicit polyline.
struct WallSpec {
  RowSpec row;
  double setback_m = 4.0;  ///< from the kerb, outwards
  double height_m = 3.0;
  double length_m = 0;     ///< of one front; 0: one wall from end to end
  double spacing_m = 3.0;  ///< between fronts
  double depth_m = 0;      ///< of the side walls at each end
  std::vector<Eigen::Vector2d> points_m;
};

/// Lamp posts, trunks.
struct PoleSpec {
  RowSpec row;
  double setback_m = 0.6;
  double every_m = 20.0;
  double radius_m = 0.08;
  double height_m = 5.0;
  Material material = Material::pole;
  std::vector<Eigen::Vector2d> points_m;
};

/// Parked cars: boxes on the road beside the kerb.
struct ParkedCarSpec {
  RowSpec row;
  double clearance_m = 0.25;  ///< from the kerb, inwards
  double length_m = 4.4, width_m = 1.8, height_m = 1.5;
  double spacing_m = 1.2;  ///< from bumper to bumper
};

struct CarSpec {
  double wheelbase_m = 2.71, track_m = 1.55, steering_ratio = 15.0;
  double lane_m = -1.75;                    ///< of the rear axle beside the centre line, left positive
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
  RoadSpec road;
  std::vector<WallSpec> walls;
  std::vector<PoleSpec> poles;
  std::vector<ParkedCarSpec> parked_cars;
  double reflectivity[kMaterialCount] = {0.15, 0.30, 0.25, 0.45, 0.60, 0.25, 0.50};
  CarSpec car;
  LidarSpec lidar;
  ErrorSpec errors;
  AnchorSpec anchor;
};

}  // namespace roadvec
