#include "tools/simulate/lidar_scanner.h"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace roadvec {
namespace {

constexpr double kNearest_m = 0.9;  ///< nearer echoes are not reported [VelodyneHDL64ES3]
/// Asphalt seen at a flat angle fades out between these ranges.
constexpr double kGroundFades_m = 80, kGroundGone_m = 120;
constexpr double kHalfBright_m = 70;  ///< range at which a surface looks half as bright

Eigen::Isometry3d mounting(const LidarSpec& lidar) {
  using Axis = Eigen::AngleAxisd;
  return Eigen::Translation3d(lidar.x_m, lidar.y_m, lidar.z_m) *
         (Axis(rad_from_deg(lidar.yaw_deg), Eigen::Vector3d::UnitZ()) *
          Axis(rad_from_deg(lidar.pitch_deg), Eigen::Vector3d::UnitY()) *
          Axis(rad_from_deg(lidar.roll_deg), Eigen::Vector3d::UnitX()));
}

Eigen::Isometry3d on_the_ground(const Pose2& pose) {
  return Eigen::Translation3d(pose.x_m, pose.y_m, 0) * Eigen::AngleAxisd(pose.theta_rad, Eigen::Vector3d::UnitZ());
}

void put_u16(std::uint8_t* at, unsigned value) {
  at[0] = static_cast<std::uint8_t>(value & 0xFF);
  at[1] = static_cast<std::uint8_t>(value >> 8 & 0xFF);
}

}  // namespace

LidarScanner::LidarScanner(const Scene& scene, const LidarHead& head, const World& world, const CarMotion& motion,
                           Random random)
    : scene_(scene),
      head_(head),
      facts_(facts_of(head.model)),
      world_(world),
      motion_(motion),
      random_(random),
      T_vehicle_lidar_(mounting(scene.lidar)),
      faces_seen_(world.faces().size()) {
  for (const LaserCalibration& laser : head.calibration.lasers) {
    lasers_.push_back(
        {std::sin(laser.elevation_rad), std::cos(laser.elevation_rad), scene.errors.laser_bias_m * random_.normal()});
  }
}

std::uint16_t LidarScanner::azimuth_cdeg(std::int64_t time_ns) const {
  const double turns = static_cast<double>(time_ns) * 1e-9 * scene_.lidar.rotation_hz;
  return static_cast<std::uint16_t>(std::lround((turns - std::floor(turns)) * kFullCircle_cdeg) % kFullCircle_cdeg);
}

const SimulatedPacket& LidarScanner::next() {
  packet_.bytes.fill(0);
  for (int block = 0; block < kBlocksPerPacket; ++block) {
    const int group = block / facts_.bank_count, bank = block % facts_.bank_count;
    std::uint8_t* at = packet_.bytes.data() + static_cast<std::size_t>(block) * kBlockBytes;
    const std::int64_t group_time_ns = time_ns_ + group * static_cast<std::int64_t>(facts_.group_period_ns);
    place_lanes(bank, group_time_ns);
    put_u16(at + kBlockFlagOffset, kBankFlags[static_cast<std::size_t>(bank)]);
    fire_block(bank, group_time_ns, at);
  }
  const auto device_us = static_cast<std::uint32_t>((scene_.start_ns + time_ns_) % kHour_ns / 1000);
  put_u16(packet_.bytes.data() + kDeviceTimeOffset, device_us & 0xFFFF);
  put_u16(packet_.bytes.data() + kDeviceTimeOffset + 2, device_us >> 16);
  put_status();
  time_ns_ += kBlocksPerPacket / facts_.bank_count * static_cast<std::int64_t>(facts_.group_period_ns);
  packet_.end = {scene_.start_ns + time_ns_};
  ++packet_count_;
  return packet_;
}

void LidarScanner::place_lanes(int bank, std::int64_t group_time_ns) {
  for (int lane = 0; lane < kLanesPerBlock; ++lane) {
    const double time_s = 1e-9 * static_cast<double>(group_time_ns + lane_time_ns(head_.model, bank, lane));
    T_scene_lidar_[static_cast<std::size_t>(lane)] = on_the_ground(motion_.at(time_s).pose) * T_vehicle_lidar_;
  }
}

void LidarScanner::fire_block(int bank, std::int64_t group_time_ns, std::uint8_t* block) {
  const std::uint16_t reading_cdeg = azimuth_cdeg(group_time_ns);
  put_u16(block + kBlockAzimuthOffset, reading_cdeg);
  for (int lane = 0; lane < kLanesPerBlock; ++lane) {
    const double after_s = 1e-9 * lane_time_ns(head_.model, bank, lane);
    // Where the decoder takes the azimuth as read, the made-up rotation corrections hold the turn.
    const double turn_rad = facts_.follow_turn ? kTwoPi * scene_.lidar.rotation_hz * after_s : 0.0;
    const double head_rad = rad_from_deg(reading_cdeg / 100.0) + turn_rad;
    const Echo echo = fire(laser_of(head_.model, bank, lane), head_rad, T_scene_lidar_[static_cast<std::size_t>(lane)]);
    std::uint8_t* at = block + kBlockEchoesOffset + static_cast<std::size_t>(lane) * kEchoBytes;
    put_u16(at, echo.raw);
    at[2] = echo.intensity;
  }
}

LidarScanner::Echo LidarScanner::fire(int laser, double beam_azimuth_rad, const Eigen::Isometry3d& T_scene_lidar) {
  const LaserCalibration& calibration = head_.calibration.lasers[static_cast<std::size_t>(laser)];
  const Laser& constants = lasers_[static_cast<std::size_t>(laser)];
  const double a_rad = beam_azimuth_rad - calibration.rotation_rad;
  const double sin_a = std::sin(a_rad), cos_a = std::cos(a_rad);
  // x ahead, y left: the decoder's formula with the distance split off (decode.h).
  const Eigen::Vector3d origin(calibration.horizontal_offset_m * sin_a, calibration.horizontal_offset_m * cos_a,
                               calibration.vertical_offset_m);
  const Eigen::Vector3d direction(constants.cos_elevation * cos_a, -constants.cos_elevation * sin_a,
                                  constants.sin_elevation);
  const Hit hit = world_.cast(T_scene_lidar * origin, T_scene_lidar.linear() * direction, scene_.lidar.range_m);
  return hit.face == Hit::kNothing ? Echo{} : echo_of(hit, laser);
}

LidarScanner::Echo LidarScanner::echo_of(const Hit& hit, int laser) {
  const double noise_m = scene_.errors.range_noise_m * random_.normal();
  const double fade_m = kGroundFades_m + (kGroundGone_m - kGroundFades_m) * random_.uniform();
  if (hit.range_m < kNearest_m || (hit.face == Hit::kGround && hit.range_m > fade_m)) return {};
  const double measured_m = hit.range_m + noise_m + lasers_[static_cast<std::size_t>(laser)].bias_m;
  const double raw = (measured_m - head_.calibration.lasers[static_cast<std::size_t>(laser)].distance_m) /
                     head_.calibration.distance_lsb_m.value_or(facts_.distance_lsb_m);
  if (raw < 0.5 || raw > 65535) return {};
  const double falloff = hit.range_m / kHalfBright_m;
  const double bright =
      scene_.reflectivity[static_cast<std::size_t>(hit.material)] * (0.3 + 0.7 * hit.cosine) / (1 + falloff * falloff);
  ++return_count_;
  if (hit.face >= 0) faces_seen_[static_cast<std::size_t>(hit.face)].add(hit.range_m);
  return {static_cast<std::uint16_t>(std::lround(raw)),
          static_cast<std::uint8_t>(std::lround(std::clamp(255 * bright, 1.0, 255.0)))};
}

/// Bytes 1204 and 1205: the return mode and the product, or an HDL-64E's cycle of 16: nine that tell the time and how
/// the head is, then seven of the calibration, here without a value. [VelodyneHDL64ES3, app. E]
void LidarScanner::put_status() {
  std::uint8_t& type = packet_.bytes[kReturnModeOffset];
  std::uint8_t& value = packet_.bytes[kProductIdOffset];
  if (facts_.has_return_mode) {
    type = kStrongestReturnMode;
    value = facts_.product_id;
    return;
  }
  const std::time_t now = (scene_.start_ns + time_ns_) / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&now, &utc);
  constexpr int kFirmware = 0x40, kTemperature_degc = 31;
  const int values[9] = {utc.tm_hour,       utc.tm_min, utc.tm_sec,        utc.tm_mday, utc.tm_mon + 1,
                         utc.tm_year - 100, 'P',        kTemperature_degc, kFirmware};
  const auto slot = static_cast<std::size_t>(packet_count_ % 16);
  type = static_cast<std::uint8_t>("HMSDNYGTV1234567"[slot]);
  value = static_cast<std::uint8_t>(slot < 9 ? values[slot] : 0);
}

}  // namespace roadvec
