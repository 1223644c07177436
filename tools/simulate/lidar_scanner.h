#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "drivers/velodyne/packet.h"
#include "tools/simulate/car_motion.h"
#include "tools/simulate/echo.h"
#include "tools/simulate/laser_beam.h"
#include "tools/simulate/lidar_head.h"
#include "tools/simulate/random.h"
#include "tools/simulate/world.h"

namespace roadvec {

/// One data packet and when its last firing was over.
struct SimulatedPacket {
  PacketBytes bytes{};
  SensorTime end;
};

/// From how near a face of the world was seen: returns by distance.
class SeenFrom {
 public:
  static constexpr double kStep_m = 10;

  void add(double range_m) {
    std::uint16_t& count = counts_[std::min(static_cast<std::size_t>(range_m / kStep_m), counts_.size() - 1)];
    if (count < kSeenReturns) ++count;
  }
  /// A multiple of kStep_m; infinity: never.
  [[nodiscard]] double within_m() const {
    int sum = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      sum += counts_[i];
      if (sum >= kSeenReturns) return static_cast<double>(i + 1) * kStep_m;
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  static constexpr int kSeenReturns = 5;  ///< a single one may be noise
  std::array<std::uint16_t, 13> counts_{};
};

/// The turning head on the moving car: casts every laser's beam from where the head is at that laser's own firing time
/// and packs what comes back, the exact inverse of PacketDecoder's formula.
///
/// A beam is its middle and two places opposite to each other in its footprint, elsewhere at every firing: with half
/// and a quarter of the light. The three are cast together, on one walk through the world.
class LidarScanner {
 public:
  /// The head has the scene's return mode.
  LidarScanner(const Scene& scene, const LidarHead& head, const World& world, const CarMotion& motion, Random random);

  /// The next packet of the drive, in place until the next call.
  [[nodiscard]] const SimulatedPacket& next();
  /// When the next packet's first firing begins, after the drive's start.
  [[nodiscard]] double time_s() const { return static_cast<double>(time_ns_) * 1e-9; }

  [[nodiscard]] std::uint64_t return_count() const { return return_count_; }
  /// Returns by face of the world: which of it was seen at all.
  [[nodiscard]] const std::vector<SeenFrom>& faces_seen() const { return faces_seen_; }

 private:
  struct Laser {
    LaserOptics optics;
    double bias_m = 0, gain = 1;
  };
  /// One laser's turn in a group, and when: share of the group's time.
  struct Shot {
    std::size_t laser = 0;
    double share = 0;
  };
  /// Of a firing, what goes into the blocks of echo 0 and 1; raw 0: nothing.
  struct Slot {
    std::uint16_t raw = 0;
    std::uint8_t intensity = 0;
  };
  using Firing = std::array<Slot, 2>;
  /// Of a beam: its middle, and the two beside it.
  using Parts = std::array<Beam, 3>;
  using Hits = std::array<Hit, 3>;

  [[nodiscard]] std::uint16_t azimuth_cdeg(std::int64_t time_ns) const;
  void fire_group(std::int64_t group_time_ns, std::uint8_t* blocks);
  [[nodiscard]] Firing fire(const Laser& laser, const HeadAzimuth& azimuth, const Eigen::Isometry3d& T_scene_lidar);
  [[nodiscard]] Parts parts_of(const LaserBeam& beam, const Eigen::Vector2d& aside,
                               const Eigen::Isometry3d& T_scene_lidar) const;
  void cast(const Parts& parts, double from_m, double to_m, Hits& hits) const;
  [[nodiscard]] Echoes echoes_of_hits(const Hits& hits) const;
  [[nodiscard]] Firing choose(const Echoes& echoes, const LaserBeam& beam, const Laser& laser);
  [[nodiscard]] Slot slot_of(const Echo& echo, const LaserBeam& beam, const Laser& laser);
  void put_status();

  const Scene& scene_;
  const ModelFacts& facts_;
  LidarModel model_;
  BeamShape shape_;
  double distance_lsb_m_;
  GroupLayout layout_;
  const World& world_;
  const CarMotion& motion_;
  Random random_;
  std::array<Surface, kMaterialCount> surfaces_;
  Eigen::Isometry3d T_vehicle_lidar_;
  std::vector<Laser> lasers_;
  std::vector<Shot> shots_;  ///< of a group, bank after bank
  std::vector<SeenFrom> faces_seen_;
  std::uint64_t return_count_ = 0, packet_count_ = 0;
  World::Moment moment_;      ///< of the firing under way: nothing moves a millimetre within one
  std::int64_t time_ns_ = 0;  ///< of the next packet's first firing, after the drive's start
  SimulatedPacket packet_;
};

}  // namespace roadvec
