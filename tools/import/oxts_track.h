#pragma once

#include <cstdint>
#include <span>

#include "core/geometry/pose2.h"
#include "tools/import/kitti_files.h"
#include "tools/recording/car_messages.h"
#include "tools/recording/output_file.h"

namespace roadvec {

/// The car that recorded KITTI, a VW Passat Variant B6: wheelbase and track by its data sheet, the steering ratio a
/// choice, because the car's bus was not recorded.
struct KittiCar {
  double wheelbase_m = 2.71, track_m = 1.55, steering_ratio = 15.0;
  double lidar_x_m = 0.76, lidar_z_m = 1.73;  ///< over the rear axle; above the road [Geiger2013, fig. 3]
};

/// Velocities, accelerations and rates come out of the OXTS box this much later than the attitude and the scans: on
/// drive 2011_09_26_drive_0005 rates fit the sweeps' turning best 50 to 90 ms back, the heading without any shift.
inline constexpr std::int64_t kOxtsLag_ns = 65'000'000;

/// What the OXTS box says at any time: between its rows evenly, before and after them as at the ends.
class OxtsTrack {
 public:
  /// At least two samples by growing time; they must outlive this.
  explicit OxtsTrack(std::span<const OxtsSample> samples) : samples_(samples) {}

  /// Attitude and position of `time`; rates, velocities and accelerations of it too, the lag taken out.
  [[nodiscard]] OxtsSample at(SensorTime time) const;

 private:
  [[nodiscard]] OxtsSample row_at(SensorTime time, double most_share) const;

  std::span<const OxtsSample> samples_;
};

/// The car's own motion at its rear axle.
struct AxleMotion {
  double speed_mps = 0, yaw_rate_radps = 0;
};
/// `imu_left_m`: how far to the left of the car's middle the box sits. There it goes slower in a left turn.
[[nodiscard]] AxleMotion axle_motion(const OxtsSample& sample, double imu_left_m);

/// What the car's bus would have carried from `from` to `to`: steering angle and wheel speeds of a car that does not
/// slip. Returns how many frames.
std::uint64_t write_can_log(const OxtsTrack& track, const KittiCar& car, double imu_left_m, SensorTime from,
                            SensorTime to, OutputFile& file);

/// The same for an Xsens in place of the OXTS box: 100 messages a second of its rates, accelerations and attitude.
std::uint64_t write_imu_log(const OxtsTrack& track, SensorTime from, SensorTime to, OutputFile& file);

}  // namespace roadvec
