#include "tools/import/firings.h"

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

constexpr double kFarthestOff_m = 0.003;
constexpr double kDistanceStep_m = 0.002;
/// The first cell of a revolution: behind straight back. On the drives looked at, the even steps of the encoder break
/// off between cells 2000 and 2004.
constexpr int kFirstCell = 2001;

int turned(int cell) { return (cell - kFirstCell + kEncoderCells) % kEncoderCells; }

/// Readings that were used, in the order of time, and those that must lie between them.
std::vector<int> readings(const LaserPoints& points, const HeadFit& head, double step_cells) {
  std::vector<bool> used(kEncoderCells + 1, false);
  for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
    for (const KittiPoint& point : points[laser]) {
      used[static_cast<std::size_t>(turned(head.lasers[laser].beam_of(point).cell))] = true;
    }
  }
  used[kEncoderCells] = true;  // the next revolution's first
  std::vector<int> cells;
  int before = -1;
  for (int at = 0; at <= kEncoderCells; ++at) {
    if (!used[static_cast<std::size_t>(at)]) continue;
    const auto step_count = std::max(1, static_cast<int>(std::lround((at - before) / step_cells)));
    for (int i = 1; i < step_count; ++i) cells.push_back(before + (at - before) * i / step_count);
    if (at < kEncoderCells) cells.push_back(at);
    before = at;
  }
  return cells;
}

}  // namespace

Firings find_firings(const LaserPoints& points, const HeadFit& head, SensorTime start, SensorTime end) {
  const double step_cells = static_cast<double>(kEncoderCells) * kFiringPeriod_ns /
                            static_cast<double>(std::max<std::int64_t>(end - start, 1));
  const std::vector<int> cells = readings(points, head, step_cells);
  Firings result;
  result.firings.resize(cells.size());
  std::vector<std::size_t> firing_of(kEncoderCells, 0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto share = static_cast<double>(i) / static_cast<double>(cells.size());
    result.firings[i].time = start + std::llround(share * static_cast<double>(end - start));
    result.firings[i].cell = (cells[i] + kFirstCell) % kEncoderCells;
    firing_of[static_cast<std::size_t>(cells[i])] = i;
  }
  for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
    for (const KittiPoint& point : points[laser]) {
      const LaserGeometry& geometry = head.lasers[laser];
      const LaserGeometry::Beam beam = geometry.beam_of(point);
      if (beam.off_the_line_m > kFarthestOff_m) ++result.off_count;
      Firing& firing = result.firings[firing_of[static_cast<std::size_t>(turned(beam.cell))]];
      const long raw = std::lround((beam.range_m - geometry.distance_m) / kDistanceStep_m);
      if (raw < 1 || raw > 0xFFFF || firing.raw[laser] != 0) {
        ++result.lost_count;
        continue;
      }
      firing.raw[laser] = static_cast<std::uint16_t>(raw);
      firing.intensity[laser] = static_cast<std::uint8_t>(std::lround(255 * static_cast<double>(point.reflectance)));
      firing.points[laser] = point;
    }
  }
  return result;
}

}  // namespace roadvec
