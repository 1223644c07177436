#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "core/base/error.h"

namespace roadvec {

/// Velodyne heads by the names that drives and configurations use. The configured model rules: what a packet says about
/// itself is not to be trusted (a VLP-16 of 2014 calls itself an HDL-32E, an HDL-64E says nothing).
enum class LidarModel : std::uint8_t { hdl64e_s2, hdl64e_s3, hdl32e, vlp16, puck_hi_res, vlp32c, vls128 };

inline constexpr int kLanesPerBlock = 32;  ///< echoes of one block

/// What one model puts where. Lane j of a block is its j-th echo; a group is the blocks that belong to one reading of
/// the azimuth. [VelodyneHDL64ES3, app. E], [VelodyneHDL32E], [VelodyneVLP16, p. 62]
struct ModelFacts {
  std::string_view name;
  bool supported = false;
  int laser_count = 0;
  int bank_count = 0;  ///< blocks of one group in single-return mode; bank b carries lasers 32 b .. 32 b + 31
  double distance_lsb_m = 0;
  std::uint32_t group_period_ns = 0;  ///< from one reading of the azimuth to the next
  bool has_return_mode = false;       ///< byte 1204 says single or dual; an HDL-64E sends status there
  std::uint8_t product_id = 0;        ///< byte 1205; 0: the model has none
  bool needs_calibration = false;
  bool follow_turn = true;  ///< lasers' azimuths follow the head inside a group; off: the calibration holds that turn
  std::span<const float> elevations_deg{};  ///< built-in angles by laser; empty: from a calibration file
};

[[nodiscard]] const ModelFacts& facts_of(LidarModel model) noexcept;
[[nodiscard]] inline std::string_view name_of(LidarModel model) noexcept { return facts_of(model).name; }

/// By name, as in DESIGN: "HDL-64E S2", "VLP-16", ... An unknown name and a model that this driver does not decode are
/// errors.
[[nodiscard]] Expected<LidarModel> lidar_model_from(std::string_view name);

/// Which laser fires into a lane of a block of bank `bank`.
[[nodiscard]] int laser_of(LidarModel model, int bank, int lane) noexcept;
/// When it fires, after the group's azimuth was read. Never falls with the lane; the banks of an HDL-64E fire side by
/// side.
[[nodiscard]] std::uint32_t lane_time_ns(LidarModel model, int lane) noexcept;

inline constexpr int kSlowestHead_rpm = 270;  ///< a margin below the 300 that all models need [VelodyneHDL64ES3, p. 5]
/// Groups in a revolution of the slowest head: a head that takes more has stopped or is still spinning up.
[[nodiscard]] std::uint32_t max_groups_per_sweep(LidarModel model) noexcept;
/// What to reserve for Sweep::returns, so that a revolution always fits. Models with dual return count both echoes.
[[nodiscard]] std::size_t max_returns_per_sweep(LidarModel model) noexcept;

}  // namespace roadvec
