#include "tools/inspect/lidar_statistics.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "core/base/angle.h"

namespace roadvec {
namespace {

constexpr std::size_t kWindow = 8;        ///< firings that a parabola is fitted to
constexpr double kNeighbours_rad = 0.02;  ///< farther apart, something between two returns is missing
/// Jumps that are counted. At larger ones the parts of a beam are told apart, and what hangs between is a thing.
constexpr double kJump_m = 0.5, kLargeJump_m = 2.0, kMidAir_m = 0.15;
constexpr double kRoadNear_m = 4, kRoadFar_m = 20, kRoadHalf_m = 2.5, kRoadBand_m = 0.2;
constexpr double kLeastOutside_m = 1.0;  ///< below the sensor: what is higher is no road

double range_of(const Return& r) {
  return std::sqrt(static_cast<double>(r.x_m) * r.x_m + static_cast<double>(r.y_m) * r.y_m +
                   static_cast<double>(r.z_m) * r.z_m);
}

template <class T>
T quantile(std::vector<T> values, double share) {
  if (values.empty()) return {};
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

template <class Values>
int histogram_quantile(const Values& counts, double share) {
  std::uint64_t whole = 0, sum = 0;
  for (const std::uint64_t count : counts) whole += count;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    sum += counts[i];
    if (static_cast<double>(sum) >= share * static_cast<double>(whole) && sum > 0) return static_cast<int>(i);
  }
  return 0;
}

double ratio(double part, double whole) { return whole > 0 ? part / whole : 0; }

bool is_road_ahead(const Return& r, double road_z_m) {
  return r.x_m > kRoadNear_m && r.x_m < kRoadFar_m && std::abs(r.y_m) < kRoadHalf_m &&
         std::abs(static_cast<double>(r.z_m) - road_z_m) < kRoadBand_m;
}

/// Height of the road before the car, where it is nearest; empty: nothing there.
std::optional<double> road_height_m(const std::vector<Return>& returns) {
  std::vector<double> heights_m;
  for (const Return& r : returns) {
    if (r.x_m > kRoadNear_m && r.x_m < 10 && std::abs(r.y_m) < 1.5F && r.z_m < -kLeastOutside_m)
      heights_m.push_back(static_cast<double>(r.z_m));
  }
  if (heights_m.size() < 50) return std::nullopt;
  return quantile(std::move(heights_m), 0.5);
}

/// Root mean square of what a parabola leaves of the ranges, for the five degrees of freedom that remain of eight.
double scatter_m(const Return* line) {
  Eigen::Matrix<double, kWindow, 3> A;
  Eigen::Matrix<double, kWindow, 1> b;
  for (std::size_t i = 0; i < kWindow; ++i) {
    const double t = static_cast<double>(i) - (kWindow - 1) / 2.0;
    A.row(static_cast<Eigen::Index>(i)) << 1, t, t * t;
    b[static_cast<Eigen::Index>(i)] = range_of(line[i]);
  }
  const Eigen::Vector3d x = (A.transpose() * A).ldlt().solve(A.transpose() * b);
  return (A * x - b).norm() / std::sqrt(kWindow - 3.0);
}

}  // namespace

StatisticsCollector::StatisticsCollector(LidarModel model)
    : facts_(facts_of(model)), lasers_(static_cast<std::size_t>(facts_.laser_count)), lines_(lasers_.size()) {
  sweep_.returns.reserve(max_returns_per_sweep(model));
}

void StatisticsCollector::add(const RawPacket& raw, const DecodedPacket& packet) {
  const std::uint32_t device_us = device_time_us(raw.bytes);
  if (packet_count_++ > 0) {
    arrival_steps_us_.push_back(1e6 * seconds_between(last_arrived_, raw.arrived));
    const std::int64_t step_us = std::int64_t{device_us} - last_device_us_;
    device_steps_us_.push_back(1e-3 * static_cast<double>(wrap_hour_ns(step_us * 1000)));
  }
  last_arrived_ = raw.arrived;
  last_device_us_ = device_us;
  const auto firings = static_cast<std::uint64_t>(packet.group_count) *
                       static_cast<std::uint64_t>(facts_.bank_count * kLanesPerBlock / facts_.laser_count);
  for (Laser& laser : lasers_) laser.firing_count += firings;
  for (int g = 0; g < packet.group_count; ++g) {
    const DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    if (group.usable) turn_to(group.azimuth_cdeg);
  }
  for (std::uint32_t i = 0; i < packet.return_count; ++i) add_return(packet.returns[i]);
}

/// What the head turned, leaving out the ways that lost packets hide.
void StatisticsCollector::turn_to(std::uint16_t azimuth_cdeg) {
  const int step_cdeg = last_azimuth_cdeg_ < 0 ? -1 : azimuth_step_cdeg(last_azimuth_cdeg_, azimuth_cdeg);
  if (step_cdeg >= 0 && step_cdeg < kLargestStep_cdeg) {
    turned_cdeg_ += step_cdeg;
    ++step_count_;
  }
  last_azimuth_cdeg_ = azimuth_cdeg;
}

void StatisticsCollector::add_return(const Return& r) {
  Laser& laser = lasers_[r.laser];
  const double range_m = range_of(r);
  const auto bin = std::ranges::upper_bound(kRangeBins_m, range_m) - kRangeBins_m.begin() - 1;
  ++ranges_[static_cast<std::size_t>(bin)];
  ++intensity_[r.intensity];
  ++laser.return_count;
  laser.elevation_sum_deg += deg_from_rad(std::asin(static_cast<double>(r.z_m) / range_m));
  // A last return is told beside the strongest one of the same firing.
  ++(r.kind == ReturnKind::last ? double_count_ : laser.answered_count);
}

void StatisticsCollector::publish() noexcept {
  ++sweep_count_;
  std::uint64_t fingerprint = 0xCBF29CE484222325;  // FNV-1a
  for (std::vector<Return>& line : lines_) line.clear();
  for (const Return& r : sweep_.returns) {
    fingerprint = (fingerprint ^ std::bit_cast<std::uint32_t>(r.x_m)) * 0x100000001B3;
    if (r.kind != ReturnKind::last) lines_[r.laser].push_back(r);
  }
  fingerprints_.insert(fingerprint);
  for (const std::vector<Return>& line : lines_) add_jumps(line);
  add_road();
}

/// Jumps in range along one laser's line, from a piece of surface to another: clean ones, and those with one return
/// between the two sides. Surfaces seen so flat that they jump from firing to firing are left out.
void StatisticsCollector::add_jumps(const std::vector<Return>& line) {
  constexpr double kSamePiece_m = 0.15;
  const auto step_m = [&](std::size_t i) {  // from return i to the next; no number: they are no neighbours
    const double turn_rad = wrap_rad(static_cast<double>(line[i + 1].azimuth_rad - line[i].azimuth_rad));
    return std::abs(turn_rad) < kNeighbours_rad ? range_of(line[i + 1]) - range_of(line[i]) : std::nan("");
  };
  const auto is_jump = [](double m) { return std::abs(m) > kJump_m && std::abs(m) < kLargeJump_m; };
  for (std::size_t i = 0; i + 4 < line.size(); ++i) {
    const std::array<double, 4> steps_m{step_m(i), step_m(i + 1), step_m(i + 2), step_m(i + 3)};
    if (!(std::abs(steps_m[0]) < kSamePiece_m)) continue;
    const bool ends_flat = std::abs(steps_m[3]) < kSamePiece_m, flat_after_one = std::abs(steps_m[2]) < kSamePiece_m;
    const double both_m = steps_m[1] + steps_m[2];
    const bool between =
        steps_m[1] * steps_m[2] > 0 && std::min(std::abs(steps_m[1]), std::abs(steps_m[2])) > kMidAir_m;
    mixed_count_ += ends_flat && between && is_jump(both_m) ? 1 : 0;
    clean_jump_count_ += flat_after_one && is_jump(steps_m[1]) ? 1 : 0;
  }
}

/// Scatter of stretches of one laser's line that lie on the road: what a parabola leaves is noise and texture.
void StatisticsCollector::add_noise(const std::vector<Return>& line, double road_z_m) {
  for (std::size_t first = 0; first + kWindow <= line.size(); first += kWindow) {
    const Return* window = line.data() + first;
    const bool on_road =
        std::all_of(window, window + kWindow, [&](const Return& r) { return is_road_ahead(r, road_z_m); });
    const double width_rad =
        std::abs(wrap_rad(static_cast<double>(window[kWindow - 1].azimuth_rad - window->azimuth_rad)));
    if (on_road && width_rad < kWindow * kNeighbours_rad) lasers_[window->laser].noises_m.push_back(scatter_m(window));
  }
}

/// The road ahead: noise along each line, and how far each laser lies off the surface through all of them, a plane with
/// a crown.
void StatisticsCollector::add_road() {
  const std::optional<double> road_z_m = road_height_m(sweep_.returns);
  if (!road_z_m) return;
  Eigen::Matrix4d N = Eigen::Matrix4d::Zero();
  Eigen::Vector4d g = Eigen::Vector4d::Zero();
  const auto terms = [](const Return& r) {
    const double x = static_cast<double>(r.x_m), y = static_cast<double>(r.y_m);
    return Eigen::Vector4d(1, x, y, y * y);
  };
  const auto each = [&](auto&& take) {
    for (const std::vector<Return>& line : lines_) {
      for (const Return& r : line) {
        if (is_road_ahead(r, *road_z_m)) take(r);
      }
    }
  };
  each([&](const Return& r) {
    N += terms(r) * terms(r).transpose();
    g += terms(r) * static_cast<double>(r.z_m);
    ++road_intensity_[r.intensity];
    ++lasers_[r.laser].road_count;
    lasers_[r.laser].road_intensity_sum += r.intensity;
  });
  const Eigen::Vector4d surface = N.ldlt().solve(g);
  each([&](const Return& r) {
    lasers_[r.laser].offset_sum_m += static_cast<double>(r.z_m) - surface.dot(terms(r));
    ++lasers_[r.laser].offset_count;
  });
  for (const std::vector<Return>& line : lines_) add_noise(line, *road_z_m);
}

LidarStatistics StatisticsCollector::figures() const {
  LidarStatistics s;
  s.model = facts_.name;
  s.revolution_count = turned_cdeg_ / kFullCircle_cdeg;
  s.sweep_count = sweep_count_;
  s.distinct_sweep_count = fingerprints_.size();
  s.revolutions_per_s = ratio(s.revolution_count, static_cast<double>(step_count_) * facts_.group_period_ns * 1e-9);
  for (std::size_t i = 0; i < 3; ++i) {
    constexpr std::array<double, 3> kShares{0.05, 0.5, 0.95};
    s.arrival_step_us[i] = quantile(arrival_steps_us_, kShares[i]);
    s.device_step_us[i] = quantile(device_steps_us_, kShares[i]);
  }
  s.packets_per_revolution = ratio(1e6, s.device_step_us[1] * s.revolutions_per_s);
  double firing_count = 0, answered_count = 0, return_count = 0;
  std::vector<double> noises_m, offsets_m, intensities;
  for (const Laser& laser : lasers_) {
    firing_count += static_cast<double>(laser.firing_count);
    answered_count += static_cast<double>(laser.answered_count);
    const auto returns = static_cast<double>(laser.return_count);
    return_count += returns;
    if (returns == 0) continue;
    const auto road_count = static_cast<double>(laser.road_count);
    s.lasers.push_back({laser.elevation_sum_deg / returns, ratio(returns, s.revolution_count),
                        1 - ratio(static_cast<double>(laser.answered_count), static_cast<double>(laser.firing_count)),
                        laser.noises_m.size(), quantile(laser.noises_m, 0.5),
                        ratio(laser.offset_sum_m, static_cast<double>(laser.offset_count)),
                        ratio(laser.road_intensity_sum, road_count)});
    constexpr std::size_t kEnoughWindows = 20;
    if (laser.noises_m.size() < kEnoughWindows) continue;
    noises_m.push_back(s.lasers.back().road_noise_m);
    offsets_m.push_back(s.lasers.back().road_offset_m);
    intensities.push_back(s.lasers.back().mean_road_intensity);
  }
  std::ranges::sort(s.lasers, std::ranges::greater(), &LaserStatistics::elevation_deg);
  s.points_per_revolution = ratio(return_count, s.revolution_count);
  s.missing_share = firing_count == 0 ? 0 : 1 - answered_count / firing_count;
  s.second_return_share = ratio(static_cast<double>(double_count_), answered_count);
  s.mixed_share = ratio(static_cast<double>(mixed_count_), static_cast<double>(mixed_count_ + clean_jump_count_));
  for (std::size_t i = 0; i < ranges_.size(); ++i)
    s.range_share[i] = ratio(static_cast<double>(ranges_[i]), return_count);
  for (std::size_t i = 0; i < s.intensity.size(); ++i) {
    constexpr std::array<double, 5> kShares{0.05, 0.25, 0.5, 0.75, 0.95};
    s.intensity[i] = histogram_quantile(intensity_, kShares[i]);
    s.road_intensity[i] = histogram_quantile(road_intensity_, kShares[i]);
  }
  s.road_noise_m = quantile(noises_m, 0.5);
  const auto spread = [](const std::vector<double>& values, double about) {
    double sum = 0;
    for (const double value : values) sum += (value - about) * (value - about);
    return std::sqrt(ratio(sum, static_cast<double>(values.size())));
  };
  s.road_offset_m = spread(offsets_m, 0);
  double mean = 0;
  for (const double value : intensities) mean += value / static_cast<double>(intensities.size());
  s.road_intensity_spread = spread(intensities, mean);
  return s;
}

}  // namespace roadvec
