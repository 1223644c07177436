#include "tools/simulate/lidar_scanner.h"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace roadvec {
namespace {

constexpr double kNearest_m = 0.9;  ///< nearer echoes are not reported [VelodyneHDL64ES3]
// Fitted to the intensities of a real HDL-64E on a street: the head evens out most of what surfaces differ by, its
// lasers' gains do not agree, and echoes of one surface scatter.
constexpr double kIntensityOfWhite = 134, kIntensityPower = 0.32, kGainSpread = 0.30, kScatter = 0.25;
/// Echoes no stronger than the weakest one heard have twice the noise of strong ones.
constexpr double kWeakNoise = 3;

Eigen::Isometry3d mounting(const LidarSpec& lidar) {
  using Axis = Eigen::AngleAxisd;
  return Eigen::Translation3d(lidar.x_m, lidar.y_m, lidar.z_m) *
         (Axis(rad_from_deg(lidar.yaw_deg), Eigen::Vector3d::UnitZ()) *
          Axis(rad_from_deg(lidar.pitch_deg), Eigen::Vector3d::UnitY()) *
          Axis(rad_from_deg(lidar.roll_deg), Eigen::Vector3d::UnitX()));
}

bool nothing(const Hit& hit) { return hit.face == Hit::kNothing; }

void put_u16(std::uint8_t* at, unsigned value) {
  at[0] = static_cast<std::uint8_t>(value & 0xFF);
  at[1] = static_cast<std::uint8_t>(value >> 8 & 0xFF);
}

}  // namespace

LidarScanner::LidarScanner(const Scene& scene, const LidarHead& head, const World& world, const CarMotion& motion,
                           Random random)
    : scene_(scene),
      facts_(facts_of(head.model)),
      model_(head.model),
      shape_(beam_shape(head.model)),
      distance_lsb_m_(head.calibration.distance_lsb_m.value_or(facts_.distance_lsb_m)),
      layout_(group_layout(head.model, scene.lidar.return_mode == ReturnMode::dual)),
      world_(world),
      motion_(motion),
      random_(random),
      surfaces_(surfaces_of(scene)),
      T_vehicle_lidar_(mounting(scene.lidar)),
      faces_seen_(world.face_count()) {
  for (LaserCalibration laser : head.calibration.lasers) {
    const double bias_m = scene.errors.laser_bias_m * (2 * random_.uniform() - 1);
    const double gain = std::exp(kGainSpread * random_.normal());
    laser.elevation_rad += rad_from_deg(scene.errors.laser_elevation_deg) * random_.normal();
    lasers_.push_back({LaserOptics(laser), bias_m, gain});
  }
  for (int bank = 0; bank < facts_.bank_count; ++bank) {
    for (int lane = 0; lane < kLanesPerBlock; ++lane) {
      shots_.push_back({static_cast<std::size_t>(laser_of(model_, bank, lane)),
                        static_cast<double>(lane_time_ns(model_, bank, lane)) / facts_.group_period_ns});
    }
  }
}

std::uint16_t LidarScanner::azimuth_cdeg(std::int64_t time_ns) const {
  const double turns = static_cast<double>(time_ns) * 1e-9 * scene_.lidar.rotation_hz;
  return static_cast<std::uint16_t>(std::lround((turns - std::floor(turns)) * kFullCircle_cdeg) % kFullCircle_cdeg);
}

const SimulatedPacket& LidarScanner::next() {
  packet_.bytes.fill(0);
  const int group_count = kBlocksPerPacket / layout_.block_count;
  for (int block = group_count * layout_.block_count; block < kBlocksPerPacket; ++block) {
    put_u16(packet_.bytes.data() + static_cast<std::size_t>(block) * kBlockBytes, kEmptyBlockFlags[1]);
  }
  for (int g = 0; g < group_count; ++g) {
    fire_group(time_ns_ + g * static_cast<std::int64_t>(facts_.group_period_ns),
               packet_.bytes.data() + static_cast<std::size_t>(g * layout_.block_count) * kBlockBytes);
  }
  const auto device_us = static_cast<std::uint32_t>((scene_.start_ns + time_ns_) % kHour_ns / 1000);
  put_u16(packet_.bytes.data() + kDeviceTimeOffset, device_us & 0xFFFF);
  put_u16(packet_.bytes.data() + kDeviceTimeOffset + 2, device_us >> 16);
  put_status();
  time_ns_ += group_count * static_cast<std::int64_t>(facts_.group_period_ns);
  packet_.end = {scene_.start_ns + time_ns_};
  ++packet_count_;
  return packet_;
}

/// All lasers once (twice in those models whose blocks hold two firings), into the group's blocks.
void LidarScanner::fire_group(std::int64_t group_time_ns, std::uint8_t* blocks) {
  const std::uint16_t reading_cdeg = azimuth_cdeg(group_time_ns);
  // Where the decoder takes the azimuth as read, the made-up rotation corrections hold the turn.
  const double reading_rad = rad_from_deg(reading_cdeg / 100.0);
  const double turn_rad = kTwoPi * scene_.lidar.rotation_hz * facts_.group_period_ns * 1e-9;
  const HeadAzimuth reading(reading_rad);
  const auto T_at = [&](double after_ns) {
    return motion_.at(1e-9 * (static_cast<double>(group_time_ns) + after_ns)).T_scene_vehicle() * T_vehicle_lidar_;
  };
  const Eigen::Isometry3d T_begin = T_at(0), T_end = T_at(facts_.group_period_ns);
  world_.look(1e-9 * static_cast<double>(group_time_ns), T_begin.translation().head<2>(), scene_.lidar.range_m,
              moment_);
  std::array<std::array<Firing, kLanesPerBlock>, kMaxBanks> firings{};
  for (std::size_t i = 0; i < shots_.size(); ++i) {
    const Shot& shot = shots_[i];
    // In the 55 us at most between the two, no bend of the way is worth a nanometre.
    Eigen::Isometry3d T_scene_lidar;
    T_scene_lidar.affine() = T_begin.affine() + shot.share * (T_end.affine() - T_begin.affine());
    firings[i / kLanesPerBlock][i % kLanesPerBlock] =
        fire(lasers_[shot.laser], facts_.follow_turn ? HeadAzimuth(reading_rad + shot.share * turn_rad) : reading,
             T_scene_lidar);
  }
  for (int i = 0; i < layout_.block_count; ++i) {
    const GroupLayout::Block role = layout_.blocks[static_cast<std::size_t>(i)];
    std::uint8_t* block = blocks + static_cast<std::size_t>(i) * kBlockBytes;
    put_u16(block + kBlockFlagOffset, kBankFlags[role.bank]);
    put_u16(block + kBlockAzimuthOffset, reading_cdeg);
    for (std::size_t lane = 0; lane < kLanesPerBlock; ++lane) {
      const Slot& slot = firings[role.bank][lane][role.echo];
      put_u16(block + kBlockEchoesOffset + lane * kEchoBytes, slot.raw);
      block[kBlockEchoesOffset + lane * kEchoBytes + 2] = slot.intensity;
    }
  }
}

LidarScanner::Firing LidarScanner::fire(const Laser& laser, const HeadAzimuth& azimuth,
                                        const Eigen::Isometry3d& T_scene_lidar) {
  Eigen::Vector2d aside;  // of a place in the footprint, out of its radius
  do {
    const std::uint64_t draw = random_.bits();
    aside = {static_cast<std::int32_t>(draw) * 0x1p-31, static_cast<std::int32_t>(draw >> 32) * 0x1p-31};
  } while (aside.squaredNorm() > 1);
  const double range_m = scene_.lidar.range_m;
  Hits hits;
  double from_m = 0;
  if (laser.optics.has_near()) {
    const LaserBeam beam = laser.optics.near_beam(azimuth);
    const Parts parts = parts_of(beam, aside, T_scene_lidar);
    const double end_m = std::min(beam.near_end_m(), range_m);
    cast(parts, 0, end_m, hits);
    if (hits[0].face != Hit::kNothing) {
      if (std::ranges::any_of(hits, nothing)) cast(parts, end_m, range_m, hits);
      return choose(echoes_of_hits(hits), beam, laser);
    }
    // The other line runs within a hand's breadth of this one, along which there was nothing.
    if (std::ranges::all_of(hits, nothing)) from_m = std::max(0.0, end_m - 0.5);
  }
  hits.fill({});
  const LaserBeam beam = laser.optics.far_beam(azimuth);
  cast(parts_of(beam, aside, T_scene_lidar), from_m, range_m, hits);
  return choose(echoes_of_hits(hits), beam, laser);
}

/// `aside`: to the right and up, of the place that the second part takes; the third lies opposite.
LidarScanner::Parts LidarScanner::parts_of(const LaserBeam& beam, const Eigen::Vector2d& aside,
                                           const Eigen::Isometry3d& T_scene_lidar) const {
  const Eigen::Vector3d right = aside.x() * beam.right, up = aside.y() * beam.up;
  const Eigen::Vector3d origin_m = T_scene_lidar * beam.origin_m, direction = T_scene_lidar.linear() * beam.direction;
  const Eigen::Vector3d beside_m = T_scene_lidar.linear() * (shape_.exit_radius_m * (right + up));
  const Eigen::Vector3d spread = T_scene_lidar.linear() * (shape_.half_width_rad * right + shape_.half_height_rad * up);
  return {
      {{origin_m, direction}, {origin_m + beside_m, direction + spread}, {origin_m - beside_m, direction - spread}}};
}

/// Casts those parts that have met nothing yet.
void LidarScanner::cast(const Parts& parts, double from_m, double to_m, Hits& hits) const {
  for (Hit& hit : hits) {
    if (nothing(hit)) hit.range_m = to_m;
  }
  const double stray_m = shape_.exit_radius_m + to_m * std::max(shape_.half_width_rad, shape_.half_height_rad);
  if (stray_m <= Scenery::kStray_m) return world_.cast(moment_, parts, from_m, hits);
  for (std::size_t k = 0; k < parts.size(); ++k) world_.cast(moment_, {&parts[k], 1}, from_m, {&hits[k], 1});
}

Echoes LidarScanner::echoes_of_hits(const Hits& hits) const {
  const auto part = [&](std::size_t k, double weight) {
    const Hit& hit = hits[k];
    if (nothing(hit)) return SubRay{std::numeric_limits<double>::infinity(), 0, weight, hit.face};
    return SubRay{hit.range_m, brightness(surfaces_[static_cast<std::size_t>(hit.material)], hit.cosine), weight,
                  hit.face};
  };
  // Nearly always in the order of their ranges.
  const std::size_t first = hits[1].range_m <= hits[2].range_m ? 1 : 2;
  const SubRay middle = part(0, 0.5);
  const auto beside = [&](std::size_t k) {
    const bool same = !nothing(hits[0]) && !nothing(hits[k]) && hits[k].material == hits[0].material &&
                      hits[k].cosine == hits[0].cosine;
    return same ? SubRay{hits[k].range_m, middle.brightness, 0.25, hits[k].face} : part(k, 0.25);
  };
  std::array<SubRay, 3> parts{beside(first), middle, beside(3 - first)};
  return echoes_of(parts);
}

/// The echoes that the receiver hears, and of those the one or two that the return mode sends. Where the strongest is
/// also the last, dual mode sends the second strongest beside it. [VelodyneVLP16, p. 55]
LidarScanner::Firing LidarScanner::choose(const Echoes& echoes, const LaserBeam& beam, const Laser& laser) {
  std::array<Echo, 3> heard;
  std::size_t count = 0;
  for (std::size_t i = 0; i < echoes.count; ++i) {
    Echo echo = echoes.list[i];
    const double scatter = std::exp(kScatter * random_.normal());
    echo.power *= scatter;
    echo.brightness *= scatter;
    if (echo.power > 1 && echo.range_m > kNearest_m) heard[count++] = echo;
  }
  Firing firing;
  if (count == 0) return firing;
  const auto weaker = [](const Echo& a, const Echo& b) { return a.power < b.power; };
  const std::size_t last = count - 1;
  auto strongest =
      static_cast<std::size_t>(std::max_element(heard.begin(), heard.begin() + count, weaker) - heard.begin());
  if (scene_.lidar.return_mode != ReturnMode::dual) {
    firing[0] = slot_of(heard[scene_.lidar.return_mode == ReturnMode::last ? last : strongest], beam, laser);
    return firing;
  }
  if (strongest == last && count > 1) {
    strongest = static_cast<std::size_t>(std::max_element(heard.begin(), heard.begin() + last, weaker) - heard.begin());
  }
  const std::size_t last_slot = layout_.kinds[0] == ReturnKind::last ? 0 : 1;
  firing[last_slot] = slot_of(heard[last], beam, laser);
  firing[1 - last_slot] = strongest == last ? firing[last_slot] : slot_of(heard[strongest], beam, laser);
  return firing;
}

LidarScanner::Slot LidarScanner::slot_of(const Echo& echo, const LaserBeam& beam, const Laser& laser) {
  const double sigma_m = scene_.errors.range_noise_m * std::sqrt(1 + kWeakNoise / echo.power);
  const double measured_m = echo.range_m + laser.bias_m + sigma_m * random_.normal();
  const double raw = beam.raw_m(measured_m) / distance_lsb_m_;
  if (raw < 0.5 || raw >= 65535) return {};
  const double intensity =
      kIntensityOfWhite * laser.gain * std::pow(echo.brightness, kIntensityPower) * (1 - 1 / echo.power);
  ++return_count_;
  if (echo.face >= 0) faces_seen_[static_cast<std::size_t>(echo.face)].add(echo.range_m);
  return {static_cast<std::uint16_t>(raw + 0.5),
          static_cast<std::uint8_t>(std::clamp(laser.optics.raw_intensity(intensity, raw), 0.0, 255.0) + 0.5)};
}

/// Bytes 1204 and 1205: the return mode and the product, or an HDL-64E's cycle of 16: nine that tell the time and how
/// the head is, then seven of the calibration, here without a value. [VelodyneHDL64ES3, app. E]
void LidarScanner::put_status() {
  std::uint8_t& type = packet_.bytes[kReturnModeOffset];
  std::uint8_t& value = packet_.bytes[kProductIdOffset];
  if (facts_.has_return_mode) {
    constexpr std::array<std::uint8_t, 3> kModes{kStrongestReturnMode, kLastReturnMode, kDualReturnMode};
    type = kModes[static_cast<std::size_t>(scene_.lidar.return_mode)];
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
