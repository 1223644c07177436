#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/float4.h"
#include "core/sensor/lidar.h"
#include "drivers/velodyne/calibration.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/model.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {

/// The echoes of one packet in firing order. Reused from packet to packet.
struct DecodedPacket {
  /// The blocks of one reading of the azimuth.
  struct Group {
    std::uint16_t azimuth_cdeg = 0;
    bool usable = false;  ///< false: the azimuth was no angle, the group has no returns
    std::uint32_t returns_begin = 0, returns_end = 0;
  };
  std::array<Group, kBlocksPerPacket> groups{};
  int group_count = 0;
  bool dual_return = false;
  std::array<Return, static_cast<std::size_t>(kBlocksPerPacket) * kLanesPerBlock>
      returns{};  ///< time_ns after the packet's first firing
  std::uint32_t return_count = 0;
};

struct DecodeOptions {
  /// On: each laser's azimuth follows the head to the moment it fires, as in [velodyne_decoder] and [VeloView]. Off:
  /// all lasers take the azimuth as read, as the HDL-64E's manual and [ros-drivers/velodyne] have it: its rotation
  /// corrections then hold the turn. Empty: as ModelFacts::follow_turn says.
  std::optional<bool> maybe_follow_turn = std::nullopt;
};

/// Packet -> returns in the `lidar` frame. Pure; after the constructor it neither allocates nor throws.
///
/// A laser's own azimuth is a = azimuth + turn(t) - rotation: the head turns on between the reading and the laser's
/// firing at t, by a share of the mean step of the packet's readings. V is the laser's elevation, R the raw distance, D
/// the far correction, dx, dy the near ones, ho, vo the offsets [VelodyneHDL64ES3, app. F]:
///
///   right = (R + Dx) cos V sin a - ho cos a
///   ahead = (R + Dy) cos V cos a + ho sin a
///   up    = (R + (Dx + Dy) / 2) sin V + vo
///   Dx = dx + (D - dx) (|X| - 2.4) / (25.04 - 2.4)     Dy = dy + (D - dy) (|Y| - 1.93) / (25.04 - 1.93)
///
/// X, Y being right and ahead by D alone, without ho; from 25.04 m on, and without near corrections, Dx = Dy = D.
/// x is ahead, y is minus right. Intensity of an HDL-64E, within the laser's minimum and maximum:
///
///   I + slope |256 (1 - focal / 131 m)^2 - 256 (1 - raw / 65535)^2|
///
/// Two returns that are one echo come out once, as ReturnKind::both.
class PacketDecoder {
 public:
  /// `calibration` has been through fit_to_model() or calibration_for().
  PacketDecoder(LidarModel model, const Calibration& calibration, const DecodeOptions& options,
                LidarCounters& counters);

  /// False (and counted): the blocks are not laid out as this model's.
  [[nodiscard]] bool decode(const PacketBytes& bytes, DecodedPacket& packet) noexcept;

  [[nodiscard]] LidarModel model() const { return model_; }
  /// How long the packet's firings took: whole group periods.
  [[nodiscard]] std::uint32_t duration_ns(const DecodedPacket& packet) const {
    return static_cast<std::uint32_t>(packet.group_count) * facts_.group_period_ns;
  }
  [[nodiscard]] std::uint32_t group_period_ns() const { return facts_.group_period_ns; }
  /// Packets whose product id is another model's: a warning, no more (see LidarModel).
  [[nodiscard]] std::uint64_t other_product_id_count() const { return other_product_id_count_; }

  static constexpr int kMaxBanks = 2;

 private:
  static constexpr std::size_t kQuads = kLanesPerBlock / 4;
  using Lanes = std::array<Float4, kQuads>;
  /// Constants of the 32 lanes of one bank, a column each, and what follows from the packet's turn.
  struct Bank {
    Lanes rotation_rad, sin_rotation, cos_rotation, sin_elevation, cos_elevation, turn_share;
    Lanes far_m, near_x, near_y, vertical_m, horizontal_m, focal_slope, focal_level, min_intensity, max_intensity;
    std::array<std::int32_t, kLanesPerBlock> distance_mask;  ///< 0: the laser is disabled
    Lanes offset_rad, sin_offset, cos_offset;                ///< of the beam from the reading: turn(t) - rotation
  };
  /// The points of up to two blocks: both banks, or both returns.
  struct alignas(64) Points {
    std::array<Float4, 2 * kLanesPerBlock> place;                 ///< x, y, z, azimuth: the first four of a Return
    std::array<std::int32_t, 2 * kLanesPerBlock> raw, intensity;  ///< raw 0: no echo
    std::array<ReturnKind, 2 * kLanesPerBlock> kind;
  };
  /// The k-th echo that leaves a group, by time: its place in Points, laser and time.
  struct Emission {
    std::uint32_t time_ns;
    std::uint8_t point, laser;
  };
  struct Heading {
    float azimuth_rad, sin, cos;
  };

  [[nodiscard]] bool laid_out_as_model(const PacketBytes& bytes) const noexcept;
  [[nodiscard]] bool has_dual_return(const PacketBytes& bytes) const noexcept;
  void read_azimuths(const PacketBytes& bytes, DecodedPacket& packet) noexcept;
  void update_turn(const DecodedPacket& packet) noexcept;
  [[nodiscard]] static Heading heading_at(std::uint16_t azimuth_cdeg) noexcept;
  void update_offsets() noexcept;
  void decode_block(const std::uint8_t* echoes, const Bank& bank, const Heading& heading,
                    std::size_t first_point) noexcept;
  void place_block(const Lanes& raw, const Bank& bank, const Heading& heading, std::size_t first_point) noexcept;
  void correct_intensity(const Lanes& raw, const Bank& bank, std::size_t first_point) noexcept;
  void merge_equal_returns() noexcept;
  void emit(std::uint32_t group_time_ns, DecodedPacket& packet) const noexcept;

  LidarModel model_;
  const ModelFacts& facts_;
  LidarCounters& counters_;
  float distance_lsb_m_;
  int max_turn_cdeg_;
  bool corrects_intensity_ = false;
  float turn_rad_ = 0;  ///< of the head, from one reading to the next
  std::array<Bank, kMaxBanks> banks_{};
  std::vector<Emission> single_order_, dual_order_;
  Points points_{};
  std::uint64_t other_product_id_count_ = 0;
};

}  // namespace roadvec
