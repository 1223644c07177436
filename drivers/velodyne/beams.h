#pragma once

#include <array>
#include <cstdint>

#include "core/base/float4.h"
#include "drivers/velodyne/calibration.h"
#include "drivers/velodyne/model.h"

namespace roadvec {

/// How a calibrated distance becomes a point where the sources differ; the formulas are in decode.h.
enum class Correction : std::uint8_t { manual, ros };

/// Constants of the 32 lanes of one bank, a column each, and what follows from the turn of the head.
struct BeamTable {
  static constexpr std::size_t kQuads = kLanesPerBlock / 4;
  using Lanes = std::array<Float4, kQuads>;

  Lanes rotation_rad{}, sin_rotation{}, cos_rotation{}, sin_elevation{}, cos_elevation{}, turn_share{};
  Lanes far_m{}, near_x{}, near_y{}, up_m{}, inward_m{}, horizontal_m{};
  Lanes focal_slope{}, focal_level{}, min_intensity{}, max_intensity{};
  std::array<std::int32_t, kLanesPerBlock> distance_mask{};  ///< 0: the laser is disabled
  Lanes offset_rad{}, sin_offset{}, cos_offset{};            ///< of the beam from the reading: turn(t) - rotation

  /// `turn_share`: of the head's turn from reading to reading, what it has turned when the laser fires.
  void set(int lane, const LaserCalibration& laser, double lane_turn_share, Correction correction) noexcept;
  /// For all blocks of a packet: the turn is the same, and so is each beam's offset from the azimuth as read.
  void turn_by(float turn_rad) noexcept;
};

/// A reading of the azimuth.
struct Heading {
  float azimuth_rad, sin, cos;
};
/// `azimuth_cdeg` below 36000.
[[nodiscard]] Heading heading_at(std::uint16_t azimuth_cdeg) noexcept;

/// The points of up to eight blocks.
struct alignas(64) BeamPoints {
  static constexpr std::size_t kMost = 2UL * kMaxBanks * kLanesPerBlock;
  std::array<Float4, kMost> place{};                   ///< x, y, z, azimuth: the first four of a Return
  std::array<std::int32_t, kMost> raw{}, intensity{};  ///< raw 0: no echo
};

/// How many lanes are worked out at once; the points are the same to the last bit.
enum class BeamLanes : std::uint8_t { four, eight };
/// Eight need AVX2.
[[nodiscard]] bool lanes_available(BeamLanes lanes) noexcept;

struct BeamOptions {
  BeamLanes lanes = lanes_available(BeamLanes::eight) ? BeamLanes::eight : BeamLanes::four;
  float distance_lsb_m = 0;
  Correction correction = Correction::manual;
  bool corrects_intensity = false;
};
/// The 32 echoes at `echoes` (and four readable bytes behind them) to points from `first_point` on. Every lane is
/// worked out, echo or not: no branch.
void place_echoes(const std::uint8_t* echoes, const BeamTable& beams, const Heading& heading,
                  const BeamOptions& options, BeamPoints& points, std::size_t first_point) noexcept;

}  // namespace roadvec
