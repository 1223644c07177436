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

constexpr std::array<float, 16> kHiRes_deg{-10.000F, 0.667F, -8.667F, 2.000F, -7.333F, 3.333F, -6.000F, 4.667F,
                                           -4.667F,  6.000F, -3.333F, 7.333F, -2.000F, 8.667F, -0.667F, 10.000F};
constexpr std::array<float, 32> kVlp32c_deg{-25.000F, -1.000F, -1.667F, -15.639F, -11.310F, 0.000F,  -0.667F, -8.843F,
                                            -7.254F,  0.333F,  -0.333F, -6.148F,  -5.333F,  1.333F,  0.667F,  -4.000F,
                                            -4.667F,  1.667F,  1.000F,  -3.667F,  -3.333F,  3.333F,  2.333F,  -2.667F,
                                            -3.000F,  7.000F,  4.667F,  -2.333F,  -2.000F,  15.000F, 10.333F, -1.333F};
constexpr std::array<float, 32> kVlp32cRotation_deg{
    -1.4F, 4.2F, -1.4F, 1.4F, -1.4F, 1.4F, -4.2F, 1.4F, -1.4F, 4.2F, -1.4F, 1.4F, -4.2F, 1.4F, -4.2F, 1.4F,
    -1.4F, 4.2F, -1.4F, 4.2F, -4.2F, 1.4F, -1.4F, 1.4F, -1.4F, 1.4F, -1.4F, 4.2F, -4.2F, 1.4F, -1.4F, 1.4F};
// VeloView's own file for this head has its lasers shuffled; these are as corrected by [velodyne_decoder].
constexpr std::array<float, 128> kVls128_deg{
    -11.742F, -1.990F,  3.400F,  -5.290F,  -0.780F, 4.610F,  -4.080F,  1.310F,  -6.500F, -1.110F,  4.280F,  -4.410F,
    0.100F,   6.480F,   -3.200F, 2.190F,   -3.860F, 1.530F,  -9.244F,  -1.770F, 2.740F,  -5.950F,  -0.560F, 4.830F,
    -2.980F,  2.410F,   -6.280F, -0.890F,  3.620F,  -5.070F, 0.320F,   7.580F,  -0.340F, 5.180F,   -3.640F, 1.750F,
    -25.000F, -2.430F,  2.960F,  -5.730F,  0.540F,  9.700F,  -2.760F,  2.630F,  -7.650F, -1.550F,  3.840F,  -4.850F,
    3.180F,   -5.510F,  -0.120F, 5.730F,   -4.300F, 1.090F,  -16.042F, -2.210F, 4.060F,  -4.630F,  0.760F,  15.000F,
    -3.420F,  1.970F,   -6.850F, -1.330F,  -5.620F, -0.230F, 5.430F,   -3.530F, 0.980F,  -19.582F, -2.320F, 3.070F,
    -4.740F,  0.650F,   11.750F, -2.650F,  1.860F,  -7.150F, -1.440F,  3.950F,  -2.100F, 3.290F,   -5.400F, -0.010F,
    4.500F,   -4.190F,  1.200F,  -13.565F, -1.220F, 4.170F,  -4.520F,  0.870F,  6.080F,  -3.310F,  2.080F,  -6.650F,
    1.420F,   -10.346F, -1.880F, 3.510F,   -6.060F, -0.670F, 4.720F,   -3.970F, 2.300F,  -6.390F,  -1.000F, 4.390F,
    -5.180F,  0.210F,   6.980F,  -3.090F,  4.980F,  -3.750F, 1.640F,   -8.352F, -2.540F, 2.850F,   -5.840F, -0.450F,
    8.430F,   -2.870F,  2.520F,  -6.170F,  -1.660F, 3.730F,  -4.960F,  0.430F};
/// By laser modulo 8: the eight that fire at once stand side by side.
constexpr std::array<float, 8> kVls128Rotation_deg{-6.354F, -4.548F, -2.732F, -0.911F, 0.911F, 2.732F, 4.548F, 6.354F};

// By LidarModel. An HDL-32E fires its lasers 1.152 us apart and rests 9.216 us; a VLP-16 block holds two sequences
// of 55.296 us. The HDL-64E's manual takes the azimuth as read for all lasers [VelodyneHDL64ES3, app. F].
constexpr std::array<ModelFacts, 7> kFacts{{
    {.name = "HDL-64E S2",
     .laser_count = 64,
     .bank_count = 2,
     .dual = DualLayout::none,
     .distance_lsb_m = 0.002,
     .group_period_ns = 48'000,
     .has_return_mode = false,
     .follow_turn = false},
    {.name = "HDL-64E S3",
     .laser_count = 64,
     .bank_count = 2,
     .dual = DualLayout::halves,
     .distance_lsb_m = 0.002,
     .group_period_ns = 57'600,
     .has_return_mode = false,
     .follow_turn = false},
    {.name = "HDL-32E",
     .laser_count = 32,
     .bank_count = 1,
     .distance_lsb_m = 0.002,
     .group_period_ns = 46'080,
     .product_id = 0x21,
     .elevations_deg = kHdl32_deg},
    {.name = "VLP-16",
     .laser_count = 16,
     .bank_count = 1,
     .distance_lsb_m = 0.002,
     .group_period_ns = 110'592,
     .product_id = 0x22,
     .elevations_deg = kVlp16_deg},
    {.name = "Puck Hi-Res",
     .laser_count = 16,
     .bank_count = 1,
     .distance_lsb_m = 0.002,
     .group_period_ns = 110'592,
     .product_id = 0x24,
     .elevations_deg = kHiRes_deg},
    {.name = "VLP-32C",
     .laser_count = 32,
     .bank_count = 1,
     .distance_lsb_m = 0.004,
     .group_period_ns = 55'296,
     .product_id = 0x28,
     .elevations_deg = kVlp32c_deg,
     .rotations_deg = kVlp32cRotation_deg},
    // 53.3 us a sequence by the first manual, 57.8 us since firmware 5.2.3; a real head of 2020 took 55.28 us.
    {.name = "VLS-128",
     .laser_count = 128,
     .bank_count = 4,
     .distance_lsb_m = 0.004,
     .group_period_ns = 55'296,
     .product_id = 0xA1,
     .elevations_deg = kVls128_deg,
     .rotations_deg = kVls128Rotation_deg},
}};

std::string known_names() {
  std::string names;
  for (const ModelFacts& facts : kFacts) {
    if (!names.empty()) names += ", ";
    names += "\"" + std::string(facts.name) + "\"";
  }
  return names;
}

}  // namespace

const ModelFacts& facts_of(LidarModel model) noexcept { return kFacts[static_cast<std::size_t>(model)]; }

Expected<LidarModel> lidar_model_from(std::string_view name) {
  for (std::size_t i = 0; i < kFacts.size(); ++i) {
    if (kFacts[i].name == name) return static_cast<LidarModel>(i);
  }
  return fail("unknown LiDAR model \"" + std::string(name) + "\"; use one of " + known_names());
}

GroupLayout group_layout(LidarModel model, bool dual) noexcept {
  const ModelFacts& facts = facts_of(model);
  const bool halves = facts.dual == DualLayout::halves;
  const int echo_count = dual ? 2 : 1;
  GroupLayout layout{.block_count = facts.bank_count * echo_count};
  layout.kinds = halves ? std::array{ReturnKind::strongest, ReturnKind::last}
                        : std::array{ReturnKind::last, ReturnKind::strongest};
  for (int i = 0; i < layout.block_count; ++i) {
    const int bank = halves ? i % facts.bank_count : i / echo_count;
    const int echo = halves ? i / facts.bank_count : i % echo_count;
    layout.blocks[static_cast<std::size_t>(i)] = {static_cast<std::uint8_t>(bank), static_cast<std::uint8_t>(echo)};
  }
  return layout;
}

int laser_of(LidarModel model, int bank, int lane) noexcept {
  const int laser = bank * kLanesPerBlock + lane;
  return laser % facts_of(model).laser_count;  // a VLP-16 fires its 16 lasers twice in a block
}

std::uint32_t lane_time_ns(LidarModel model, int bank, int lane) noexcept {
  const auto j = static_cast<std::uint32_t>(lane);
  const auto b = static_cast<std::uint32_t>(bank);
  switch (model) {
    case LidarModel::hdl64e_s2: {
      constexpr std::array<std::uint32_t, 4> kInFour_ns{0, 1'260, 2'460, 3'660};
      return 6'000 * (j / 4) + kInFour_ns[j % 4];
    }
    case LidarModel::hdl64e_s3: {
      constexpr std::array<std::uint32_t, 4> kInFour_ns{0, 1'300, 2'500, 3'700};
      return 7'200 * (j / 4) + kInFour_ns[j % 4];
    }
    case LidarModel::hdl32e:
      return 1'152 * j;
    case LidarModel::vlp16:
    case LidarModel::puck_hi_res:
      return 2'304 * (j % 16) + 55'296 * (j / 16);
    case LidarModel::vlp32c:
      return 2'304 * (j / 2);
    case LidarModel::vls128:
      // Eight lasers at once, 2.665 us apart; after each half of the sixteen shots two are left out.
      return 2'665 * (4 * b + j / 8 + 2 * (b / 2));
  }
  return 0;
}

std::uint32_t group_span_ns(LidarModel model) noexcept {
  return lane_time_ns(model, facts_of(model).bank_count - 1, kLanesPerBlock - 1);
}

std::uint32_t max_groups_per_sweep(LidarModel model) noexcept {
  return static_cast<std::uint32_t>(60'000'000'000 / kSlowestHead_rpm / facts_of(model).group_period_ns);
}

std::size_t max_returns_per_sweep(LidarModel model) noexcept {
  const ModelFacts& facts = facts_of(model);
  const int echo_count = facts.dual == DualLayout::none ? 1 : 2;
  return static_cast<std::size_t>(max_groups_per_sweep(model)) *
         static_cast<std::size_t>(facts.bank_count * kLanesPerBlock * echo_count);
}

}  // namespace roadvec
