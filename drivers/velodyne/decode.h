#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/float4.h"
#include "core/sensor/lidar.h"
#include "drivers/velodyne/beams.h"
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
    bool usable = false;         ///< false: the azimuth was no angle, the group has no returns
    std::uint32_t start_ns = 0;  ///< after the packet's first firing
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
  Correction correction = Correction::manual;
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
/// Correction::ros: as [ros-drivers/velodyne], which has Dx, Dy at all distances and turns the vertical offset with the
/// beam: (R + Dx) cos V - vo sin V and the same with Dy in the first two lines, up = (R + Dy) sin V + vo cos V. That is
/// up to 9 cm nearer or farther. x is ahead, y is minus right. Intensity of an HDL-64E, within the laser's minimum and
/// maximum:
///
///   I + slope |256 (1 - focal / 131 m)^2 - 256 (1 - raw / 65535)^2|
///
/// Two returns that are one echo come out once, as ReturnKind::both.
class PacketDecoder {
 public:
  /// `calibration` has been through fit_to_model() or calibration_for(); one that is streamed comes by calibrate(), and
  /// until then there are no returns.
  PacketDecoder(LidarModel model, const Calibration& calibration, const DecodeOptions& options,
                LidarCounters& counters);

  /// From the next packet on. Does not allocate.
  void calibrate(const Calibration& calibration) noexcept;

  /// False (and counted): the blocks are not laid out as this model's, or in a mode that is not decoded.
  [[nodiscard]] bool decode(const PacketBytes& bytes, DecodedPacket& packet) noexcept;

  [[nodiscard]] LidarModel model() const { return model_; }
  /// How long the packet's firings took: whole group periods, and the sector that a head set to a field of view leaves
  /// out.
  [[nodiscard]] std::uint32_t duration_ns(const DecodedPacket& packet) const {
    return packet.groups[static_cast<std::size_t>(packet.group_count - 1)].start_ns + facts_.group_period_ns;
  }
  /// Packets whose product id is another model's: a warning, no more (see LidarModel).
  [[nodiscard]] std::uint64_t other_product_id_count() const { return other_product_id_count_; }

 private:
  /// The k-th echo that leaves a group, by time: its place in BeamPoints, and its Return from time_ns on as one number.
  struct Emission {
    std::uint64_t tail;
    std::uint32_t point;
  };
  /// What single and dual return put where.
  struct Mode {
    GroupLayout layout;
    std::array<Emission, BeamPoints::kMost> order{};
    std::size_t echo_count = 0;  ///< of `order`
  };

  [[nodiscard]] Mode make_mode(bool dual) const;
  [[nodiscard]] bool laid_out_as(const GroupLayout& layout, const PacketBytes& bytes) const noexcept;
  [[nodiscard]] bool in_unread_mode(const PacketBytes& bytes) const noexcept;
  [[nodiscard]] bool has_dual_return(const PacketBytes& bytes) noexcept;
  void read_azimuths(const PacketBytes& bytes, const GroupLayout& layout, DecodedPacket& packet) noexcept;
  void update_turn(const PacketBytes& bytes, DecodedPacket& packet) noexcept;
  [[nodiscard]] std::optional<double> place_groups(DecodedPacket& packet) const noexcept;
  [[nodiscard]] std::optional<double> turn_since_last(const PacketBytes& bytes,
                                                      const DecodedPacket& packet) const noexcept;
  void merge_equal_returns(const GroupLayout& layout) noexcept;
  template <bool kDual>
  void emit(const Mode& mode, std::uint32_t group_time_ns, DecodedPacket& packet) const noexcept;

  LidarModel model_;
  const ModelFacts& facts_;
  LidarCounters& counters_;
  DecodeOptions options_;
  BeamOptions beam_options_;
  int max_turn_cdeg_;
  double turn_cdeg_ = 0;                                ///< of the head, from one reading to the next
  bool standing_was_dual_ = false;                      ///< how an HDL-64E's last packets were, whose azimuths told
  std::uint16_t last_azimuth_cdeg_ = kFullCircle_cdeg;  ///< of the packet before; no angle: none yet
  std::uint32_t last_device_us_ = 0;
  std::array<BeamTable, kMaxBanks> banks_{};
  Mode single_, dual_;
  BeamPoints points_{};
  std::array<ReturnKind, BeamPoints::kMost> kinds_{};
  std::uint64_t other_product_id_count_ = 0;
};

}  // namespace roadvec
