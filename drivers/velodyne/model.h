#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "core/sensor/lidar.h"

namespace roadvec {

/// Velodyne heads by the names that drives and configurations use. The configured model rules: what a packet says about
/// itself is not to be trusted (a VLP-16 of 2014 calls itself an HDL-32E, an HDL-64E says nothing).
enum class LidarModel : std::uint8_t { hdl64e_s2, hdl64e_s3, hdl32e, vlp16, puck_hi_res, vlp32c, vls128 };

inline constexpr int kLanesPerBlock = 32;  ///< echoes of one block

/// How a head that sends two returns of a firing puts them into a group.
enum class DualLayout : std::uint8_t {
  none,
  pairs,   ///< two blocks of each bank, last before strongest [VelodyneVLP16, p. 55]
  halves,  ///< all banks' strongest, then all banks' last [VelodyneHDL64ES3] [velodyne_decoder]
};

/// What one model puts where. Lane j of a block is its j-th echo; a group is the blocks that belong to one reading of
/// the azimuth. [VelodyneHDL64ES3, app. E], [VelodyneHDL32E], [VelodyneVLP16, p. 62], [VelodyneVLS128]
struct ModelFacts {
  std::string_view name;
  int laser_count = 0;
  int bank_count = 0;  ///< blocks of one group in single-return mode; bank b carries lasers 32 b .. 32 b + 31
  DualLayout dual = DualLayout::pairs;
  double distance_lsb_m = 0;
  std::uint32_t group_period_ns = 0;  ///< from one reading of the azimuth to the next
  bool has_return_mode = true;        ///< byte 1204 says single or dual; an HDL-64E sends status there
  std::uint8_t product_id = 0;        ///< byte 1205; 0: the model has none
  bool follow_turn = true;  ///< lasers' azimuths follow the head inside a group; off: the calibration holds that turn
  std::span<const float> elevations_deg{};  ///< built-in angles by laser; empty: from a calibration
  std::span<const float> rotations_deg{};   ///< likewise, over and over by laser; empty: none

  [[nodiscard]] bool needs_calibration() const { return elevations_deg.empty(); }
};

[[nodiscard]] const ModelFacts& facts_of(LidarModel model) noexcept;
[[nodiscard]] inline std::string_view name_of(LidarModel model) noexcept { return facts_of(model).name; }

/// By name: "HDL-64E S2", "VLP-16", ... An unknown name is an error that lists the known ones.
[[nodiscard]] Expected<LidarModel> lidar_model_from(std::string_view name);

inline constexpr int kMaxBanks = 4;
/// The blocks of one group, in the order they are sent.
struct GroupLayout {
  struct Block {
    std::uint8_t bank = 0;
    std::uint8_t echo = 0;  ///< 0 or 1; in single-return mode always 0
  };
  std::array<Block, 2 * kMaxBanks> blocks{};
  int block_count = 0;
  std::array<ReturnKind, 2> kinds{};  ///< of echo 0 and 1
};
/// `dual` only for a model whose ModelFacts::dual is not none. Blocks of a packet that no whole group fits into are
/// empty.
[[nodiscard]] GroupLayout group_layout(LidarModel model, bool dual) noexcept;

/// Which laser fires into a lane of a block of bank `bank`.
[[nodiscard]] int laser_of(LidarModel model, int bank, int lane) noexcept;
/// When it fires, after the group's first firing. Never falls with bank and lane, but that the banks of an HDL-64E fire
/// side by side.
[[nodiscard]] std::uint32_t lane_time_ns(LidarModel model, int bank, int lane) noexcept;
/// From the first firing of a group to its last.
[[nodiscard]] std::uint32_t group_span_ns(LidarModel model) noexcept;

inline constexpr int kSlowestHead_rpm = 270;  ///< a margin below the 300 that all models need [VelodyneHDL64ES3, p. 5]
/// Groups in a revolution of the slowest head: a head that takes more has stopped or is still spinning up.
[[nodiscard]] std::uint32_t max_groups_per_sweep(LidarModel model) noexcept;
/// What to reserve for Sweep::returns, so that a revolution always fits. Models with dual return count both echoes.
[[nodiscard]] std::size_t max_returns_per_sweep(LidarModel model) noexcept;

}  // namespace roadvec
