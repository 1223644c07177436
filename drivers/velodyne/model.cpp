#include "drivers/velodyne/model.h"

#include <array>
#include <string>

namespace roadvec {
namespace {

// Elevations in the order the lasers come in a packet, from the makers' calibration files [VeloView].
constexpr std::array<float, 16> kVlp16_deg{-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
constexpr std::array<float, 32> kHdl32_deg{-30.67F, -9.33F, -29.33F, -8.00F, -28.00F, -6.67F, -26.67F, -5.33F,
                                           -25.33F, -4.00F, -24.00F, -2.67F, -22.67F, -1.33F, -21.33F, 0.00F,
                                           -20.00F, 1.33F,  -18.67F, 2.67F,  -17.33F, 4.00F,  -16.00F, 5.33F,
                                           -14.67F, 6.67F,  -13.33F, 8.00F,  -12.00F, 9.33F,  -10.67F, 10.67F};

// By LidarModel. An HDL-32E fires its lasers 1.152 us apart and rests 9.216 us; a VLP-16 block holds two sequences
// of 55.296 us.
constexpr std::array<ModelFacts, 7> kFacts{{
    {.name = "HDL-64E S2",
     .supported = true,
     .laser_count = 64,
     .bank_count = 2,
     .distance_lsb_m = 0.002,
     .group_period_ns = 48'000,
     .has_return_mode = false,
     .product_id = 0,
     .needs_calibration = true,
     .follow_turn = false,  // [VelodyneHDL64ES3, app. F] takes the azimuth as read for all lasers
     .elevations_deg = {}},
    {.name = "HDL-64E S3"},
    {.name = "HDL-32E",
     .supported = true,
     .laser_count = 32,
     .bank_count = 1,
     .distance_lsb_m = 0.002,
     .group_period_ns = 46'080,
     .has_return_mode = true,
     .product_id = 0x21,
     .needs_calibration = false,
     .follow_turn = true,
     .elevations_deg = kHdl32_deg},
    {.name = "VLP-16",
     .supported = true,
     .laser_count = 16,
     .bank_count = 1,
     .distance_lsb_m = 0.002,
     .group_period_ns = 110'592,
     .has_return_mode = true,
     .product_id = 0x22,
     .needs_calibration = false,
     .follow_turn = true,
     .elevations_deg = kVlp16_deg},
    {.name = "Puck Hi-Res"},
    {.name = "VLP-32C"},
    {.name = "VLS-128"},
}};

std::string supported_names() {
  std::string names;
  for (const ModelFacts& facts : kFacts) {
    if (!facts.supported) continue;
    if (!names.empty()) names += ", ";
    names += "\"" + std::string(facts.name) + "\"";
  }
  return names;
}

}  // namespace

const ModelFacts& facts_of(LidarModel model) noexcept { return kFacts[static_cast<std::size_t>(model)]; }

Expected<LidarModel> lidar_model_from(std::string_view name) {
  for (std::size_t i = 0; i < kFacts.size(); ++i) {
    if (kFacts[i].name != name) continue;
    if (kFacts[i].supported) return static_cast<LidarModel>(i);
    return fail("LiDAR model \"" + std::string(name) + "\" is known but not decoded by this version; it decodes " +
                supported_names());
  }
  return fail("unknown LiDAR model \"" + std::string(name) + "\"; use one of " + supported_names());
}

int laser_of(LidarModel model, int bank, int lane) noexcept {
  const int laser = bank * kLanesPerBlock + lane;
  return laser % facts_of(model).laser_count;  // a VLP-16 fires its 16 lasers twice in a block
}

std::uint32_t lane_time_ns(LidarModel model, int lane) noexcept {
  const auto j = static_cast<std::uint32_t>(lane);
  switch (model) {
    case LidarModel::hdl64e_s2: {
      constexpr std::array<std::uint32_t, 4> kInFour_ns{0, 1'260, 2'460, 3'660};
      return 6'000 * (j / 4) + kInFour_ns[j % 4];
    }
    case LidarModel::vlp16:
      return 2'304 * (j % 16) + 55'296 * (j / 16);
    default:
      return 1'152 * j;
  }
}

std::uint32_t max_groups_per_sweep(LidarModel model) noexcept {
  return static_cast<std::uint32_t>(60'000'000'000 / kSlowestHead_rpm / facts_of(model).group_period_ns);
}

std::size_t max_returns_per_sweep(LidarModel model) noexcept {
  const ModelFacts& facts = facts_of(model);
  const int echo_count = facts.has_return_mode ? 2 : 1;
  return static_cast<std::size_t>(max_groups_per_sweep(model)) *
         static_cast<std::size_t>(facts.bank_count * kLanesPerBlock * echo_count);
}

}  // namespace roadvec
