#include "drivers/velodyne/beams.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/base/angle.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {
namespace {

// Distances at which the lasers were calibrated [VelodyneHDL64ES3, app. F].
constexpr double kFar_m = 25.04, kNearX_m = 2.4, kNearY_m = 1.93;
constexpr double kFocalRange_m = 131.0;  ///< 65535 steps of 2 mm

/// Sine and cosine of a whole azimuth word from two small tables: degrees, and hundredths.
struct AzimuthTable {
  struct Entry {
    double sin, cos;
  };
  std::array<Entry, 360> degrees;
  std::array<Entry, 100> hundredths;

  AzimuthTable() {
    for (std::size_t i = 0; i < degrees.size(); ++i) degrees[i] = entry(static_cast<double>(i));
    for (std::size_t i = 0; i < hundredths.size(); ++i) hundredths[i] = entry(static_cast<double>(i) / 100.0);
  }
  static Entry entry(double deg) { return {std::sin(rad_from_deg(deg)), std::cos(rad_from_deg(deg))}; }
  [[nodiscard]] Entry at(std::uint16_t cdeg) const noexcept {
    const Entry a = degrees[cdeg / 100], b = hundredths[cdeg % 100];
    return {a.sin * b.cos + a.cos * b.sin, a.cos * b.cos - a.sin * b.sin};
  }
};
const AzimuthTable kAzimuths;

// The same steps for four lanes at a time (SSE2, NEON) and for eight (AVX2). None mixes lanes, and none fuses a
// multiplication with an addition, so both give the same bits. Everything is inlined into one function per instruction
// set and goes by reference: eight lanes have no calling convention without AVX2.

using Float8 = float __attribute__((vector_size(32)));
using Int8 = std::int32_t __attribute__((vector_size(32)));
using Bytes16 = std::uint8_t __attribute__((vector_size(16)));

template <class F>
[[gnu::always_inline]] inline void load_lanes(const BeamTable::Lanes& column, std::size_t lane, F& out) noexcept {
  std::memcpy(&out, reinterpret_cast<const float*>(&column) + lane, sizeof out);
}

/// Distance in the lower two bytes, then intensity, then anything.
[[gnu::always_inline]] inline void load_echoes(const std::uint8_t* echo, Int4& out) noexcept {
  out = Int4{load<std::int32_t>(echo), load<std::int32_t>(echo + kEchoBytes), load<std::int32_t>(echo + 2 * kEchoBytes),
             load<std::int32_t>(echo + 3 * kEchoBytes)};
}
[[gnu::always_inline]] inline void load_echoes(const std::uint8_t* echo, Int8& out) noexcept {
  Bytes16 low, high;
  std::memcpy(&low, echo, sizeof low);
  std::memcpy(&high, echo + 4 * kEchoBytes, sizeof high);
  out = (Int8)__builtin_shufflevector(low, high, 0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 9, 10, 11, 11, 16, 17, 18, 18, 19,
                                      20, 21, 21, 22, 23, 24, 24, 25, 26, 27, 27);
}

/// Columns to rows: a 4 x 4 transposition.
[[gnu::always_inline]] inline void store_rows(const Float4& x, const Float4& y, const Float4& z, const Float4& azimuth,
                                              Float4* rows) noexcept {
  const Float4 xy01 = __builtin_shufflevector(x, y, 0, 4, 1, 5), xy23 = __builtin_shufflevector(x, y, 2, 6, 3, 7);
  const Float4 za01 = __builtin_shufflevector(z, azimuth, 0, 4, 1, 5);
  const Float4 za23 = __builtin_shufflevector(z, azimuth, 2, 6, 3, 7);
  rows[0] = __builtin_shufflevector(xy01, za01, 0, 1, 4, 5);
  rows[1] = __builtin_shufflevector(xy01, za01, 2, 3, 6, 7);
  rows[2] = __builtin_shufflevector(xy23, za23, 0, 1, 4, 5);
  rows[3] = __builtin_shufflevector(xy23, za23, 2, 3, 6, 7);
}
[[gnu::always_inline]] inline void store_rows(const Float8& x, const Float8& y, const Float8& z, const Float8& azimuth,
                                              Float4* rows) noexcept {
  store_rows(__builtin_shufflevector(x, x, 0, 1, 2, 3), __builtin_shufflevector(y, y, 0, 1, 2, 3),
             __builtin_shufflevector(z, z, 0, 1, 2, 3), __builtin_shufflevector(azimuth, azimuth, 0, 1, 2, 3), rows);
  store_rows(__builtin_shufflevector(x, x, 4, 5, 6, 7), __builtin_shufflevector(y, y, 4, 5, 6, 7),
             __builtin_shufflevector(z, z, 4, 5, 6, 7), __builtin_shufflevector(azimuth, azimuth, 4, 5, 6, 7),
             rows + 4);
}

template <class F, class I, Correction kCorrection>
[[gnu::always_inline]] inline void place_lanes(const F& raw, const BeamTable& beams, std::size_t lane,
                                               const Heading& heading, float distance_lsb_m, Float4* rows) noexcept {
  constexpr auto kTwoPi_f = static_cast<float>(kTwoPi);
  constexpr auto kFar_f = static_cast<float>(kFar_m);
  F cos_offset, sin_offset, cos_elevation, sin_elevation, offset_rad, correction_m, slope_x, slope_y, horizontal_m,
      up_m;
  load_lanes(beams.cos_offset, lane, cos_offset);
  load_lanes(beams.sin_offset, lane, sin_offset);
  load_lanes(beams.cos_elevation, lane, cos_elevation);
  load_lanes(beams.sin_elevation, lane, sin_elevation);
  load_lanes(beams.offset_rad, lane, offset_rad);
  load_lanes(beams.far_m, lane, correction_m);
  load_lanes(beams.near_x, lane, slope_x);
  load_lanes(beams.near_y, lane, slope_y);
  load_lanes(beams.horizontal_m, lane, horizontal_m);
  load_lanes(beams.up_m, lane, up_m);
  const F sin_a = heading.sin * cos_offset + heading.cos * sin_offset;
  const F cos_a = heading.cos * cos_offset - heading.sin * sin_offset;
  const F flat_sin = cos_elevation * sin_a, flat_cos = cos_elevation * cos_a;

  const F raw_m = raw * distance_lsb_m;
  const F far_m = raw_m + correction_m;
  const F across_m = far_m * flat_sin, along_m = far_m * flat_cos;
  F near_x_m = slope_x * (kFar_f - (F)((I)across_m & 0x7FFFFFFF));
  F near_y_m = slope_y * (kFar_f - (F)((I)along_m & 0x7FFFFFFF));
  if constexpr (kCorrection == Correction::manual) {
    const I is_near = raw_m < kFar_f;
    near_x_m = (F)(is_near & (I)near_x_m);
    near_y_m = (F)(is_near & (I)near_y_m);
  }
  F left_m = horizontal_m * cos_a - (far_m + near_x_m) * flat_sin;
  F ahead_m = horizontal_m * sin_a + (far_m + near_y_m) * flat_cos;
  F slant_m = far_m + 0.5F * (near_x_m + near_y_m);
  if constexpr (kCorrection == Correction::ros) {
    F inward_m;
    load_lanes(beams.inward_m, lane, inward_m);
    left_m += inward_m * sin_a;
    ahead_m -= inward_m * cos_a;
    slant_m = far_m + near_y_m;
  }
  const F height_m = slant_m * sin_elevation + up_m;

  const F full_circle = F{} + kTwoPi_f;
  F azimuth_rad = heading.azimuth_rad + offset_rad;
  azimuth_rad += (F)((I)(azimuth_rad < 0.0F) & (I)full_circle);
  azimuth_rad -= (F)((I)(azimuth_rad >= kTwoPi_f) & (I)full_circle);
  store_rows(ahead_m, left_m, height_m, azimuth_rad, rows);
}

template <class F, class I>
[[gnu::always_inline]] inline void correct_intensity(const F& raw, const BeamTable& beams, std::size_t lane,
                                                     I& intensity) noexcept {
  F slope, focal_level, least, most;
  load_lanes(beams.focal_slope, lane, slope);
  load_lanes(beams.focal_level, lane, focal_level);
  load_lanes(beams.min_intensity, lane, least);
  load_lanes(beams.max_intensity, lane, most);
  const F closeness = 1.0F - raw * (1.0F / 65535.0F);
  const F level = focal_level - 256.0F * closeness * closeness;
  F corrected = __builtin_convertvector(intensity, F) + slope * (F)((I)level & 0x7FFFFFFF);
  corrected = corrected > least ? corrected : least;
  corrected = corrected < most ? corrected : most;
  intensity = __builtin_convertvector(corrected + 0.5F, I);
}

template <class F, class I, Correction kCorrection>
[[gnu::always_inline]] inline void place(const std::uint8_t* echoes, const BeamTable& beams, const Heading& heading,
                                         const BeamOptions& options, BeamPoints& points,
                                         std::size_t first_point) noexcept {
  for (std::size_t lane = 0; lane < kLanesPerBlock; lane += sizeof(F) / sizeof(float)) {
    I words, mask;
    load_echoes(echoes + lane * kEchoBytes, words);
    std::memcpy(&mask, &beams.distance_mask[lane], sizeof mask);
    const I distance = words & 0xFFFF & mask;
    const F raw = __builtin_convertvector(distance, F);
    I intensity = words >> 16 & 0xFF;
    if (options.corrects_intensity) correct_intensity(raw, beams, lane, intensity);
    const std::size_t point = first_point + lane;
    std::memcpy(&points.raw[point], &distance, sizeof distance);
    std::memcpy(&points.intensity[point], &intensity, sizeof intensity);
    place_lanes<F, I, kCorrection>(raw, beams, lane, heading, options.distance_lsb_m, &points.place[point]);
  }
}

using Place = void (*)(const std::uint8_t*, const BeamTable&, const Heading&, const BeamOptions&, BeamPoints&,
                       std::size_t) noexcept;

template <Correction kCorrection>
void place_by_four(const std::uint8_t* echoes, const BeamTable& beams, const Heading& heading,
                   const BeamOptions& options, BeamPoints& points, std::size_t first_point) noexcept {
  place<Float4, Int4, kCorrection>(echoes, beams, heading, options, points, first_point);
}

#ifdef __x86_64__
template <Correction kCorrection>
[[gnu::target("avx2")]] void place_by_eight(const std::uint8_t* echoes, const BeamTable& beams, const Heading& heading,
                                            const BeamOptions& options, BeamPoints& points,
                                            std::size_t first_point) noexcept {
  place<Float8, Int8, kCorrection>(echoes, beams, heading, options, points, first_point);
}
#endif

}  // namespace

void BeamTable::set(int lane, const LaserCalibration& laser, double lane_turn_share, Correction correction) noexcept {
  const auto quad = static_cast<std::size_t>(lane) / 4, j = static_cast<std::size_t>(lane) % 4;
  const auto put = [=](Lanes& column, double value) { column[quad][j] = static_cast<float>(value); };
  const double sin_elevation_ = std::sin(laser.elevation_rad), cos_elevation_ = std::cos(laser.elevation_rad);
  const bool two_point = laser.distance_x_m != 0 && laser.distance_y_m != 0;
  const bool ros = correction == Correction::ros;
  put(rotation_rad, wrap_rad(laser.rotation_rad));
  put(sin_rotation, std::sin(laser.rotation_rad));
  put(cos_rotation, std::cos(laser.rotation_rad));
  put(sin_elevation, sin_elevation_);
  put(cos_elevation, cos_elevation_);
  put(turn_share, lane_turn_share);
  put(far_m, laser.distance_m);
  put(near_x, two_point ? (laser.distance_x_m - laser.distance_m) / (kFar_m - kNearX_m) : 0.0);
  put(near_y, two_point ? (laser.distance_y_m - laser.distance_m) / (kFar_m - kNearY_m) : 0.0);
  put(up_m, laser.vertical_offset_m * (ros ? cos_elevation_ : 1.0));
  put(inward_m, ros ? laser.vertical_offset_m * sin_elevation_ : 0.0);
  put(horizontal_m, laser.horizontal_offset_m);
  put(focal_slope, laser.focal_slope);
  const double closeness = 1.0 - laser.focal_distance_m / kFocalRange_m;
  put(focal_level, 256.0 * closeness * closeness);
  put(min_intensity, std::clamp(laser.min_intensity, 0.0, 255.0));
  put(max_intensity, std::clamp(laser.max_intensity, 0.0, 255.0));
  distance_mask[static_cast<std::size_t>(lane)] = laser.enabled ? -1 : 0;
}

void BeamTable::turn_by(float turn_rad) noexcept {
  for (std::size_t quad = 0; quad < kQuads; ++quad) {
    // The turn stays below 1.6 degrees (40 turns a second in 111 us): the series are exact to 1e-7.
    const Float4 turn = turn_rad * turn_share[quad];
    const Float4 sin_turn = turn - turn * turn * turn * (1.0F / 6.0F);
    const Float4 cos_turn = 1.0F - turn * turn * 0.5F;
    offset_rad[quad] = turn - rotation_rad[quad];
    sin_offset[quad] = sin_turn * cos_rotation[quad] - cos_turn * sin_rotation[quad];
    cos_offset[quad] = cos_turn * cos_rotation[quad] + sin_turn * sin_rotation[quad];
  }
}

Heading heading_at(std::uint16_t azimuth_cdeg) noexcept {
  const AzimuthTable::Entry entry = kAzimuths.at(azimuth_cdeg);
  return {static_cast<float>(rad_from_deg(azimuth_cdeg / 100.0)), static_cast<float>(entry.sin),
          static_cast<float>(entry.cos)};
}

bool lanes_available(BeamLanes lanes) noexcept {
#ifdef __x86_64__
  return lanes == BeamLanes::four || __builtin_cpu_supports("avx2") != 0;
#else
  return lanes == BeamLanes::four;
#endif
}

void place_echoes(const std::uint8_t* echoes, const BeamTable& beams, const Heading& heading,
                  const BeamOptions& options, BeamPoints& points, std::size_t first_point) noexcept {
  const bool ros = options.correction == Correction::ros;
  Place run = ros ? place_by_four<Correction::ros> : place_by_four<Correction::manual>;
#ifdef __x86_64__
  if (options.lanes == BeamLanes::eight) {
    run = ros ? place_by_eight<Correction::ros> : place_by_eight<Correction::manual>;
  }
#endif
  run(echoes, beams, heading, options, points, first_point);
}

}  // namespace roadvec
