#include "core/map/dense_lines.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/base/ensure.h"

namespace roadvec {
namespace {

constexpr double kCell_m = 2.0;
// Vertices move across their line after they were appended; a segment may then be a little longer than it was.
constexpr double kStretch = 1.2;

std::int64_t cell_of(double coordinate_m) { return static_cast<std::int64_t>(std::floor(coordinate_m / kCell_m)); }
std::uint64_t key_of(std::int64_t column, std::int64_t row) {
  return (static_cast<std::uint64_t>(column) << 32) ^ (static_cast<std::uint64_t>(row) & 0xffffffffU);
}
std::uint64_t key_of(const Eigen::Vector2d& p) { return key_of(cell_of(p.x()), cell_of(p.y())); }

}  // namespace

Eigen::Vector2d DenseLine::direction_at(std::int32_t position) const {
  const std::int32_t before = std::max(first_position, position - 1),
                     after = std::min(end_position() - 1, position + 1);
  const Eigen::Vector2d chord = at(after).p - at(before).p;
  const double length = chord.norm();
  return length > 0 ? Eigen::Vector2d(chord / length) : Eigen::Vector2d(Eigen::Vector2d::UnitX());
}

DenseLines::DenseLines(double spacing_m) : longest_segment_m_(kStretch * spacing_m) {}

DenseLine& DenseLines::create(LineId id) {
  const auto [it, is_new] = lines_.try_emplace(id);
  ENSURE(is_new);
  it->second.id = id;
  return it->second;
}

void DenseLines::append(DenseLine& line, const DenseVertex& vertex) {
  line.vertices.push_back(vertex);
  enter(line, line.end_position() - 1);
}

void DenseLines::prepend(DenseLine& line, const DenseVertex& vertex) {
  line.vertices.push_front(vertex);
  --line.first_position;
  enter(line, line.first_position);
}

void DenseLines::move(DenseLine& line, std::int32_t position, const Eigen::Vector2d& to) {
  leave(line, position);
  line.at(position).p = to;
  enter(line, position);
}

DenseLine DenseLines::take(LineId id) {
  const auto it = lines_.find(id);
  ENSURE(it != lines_.end());
  for (std::int32_t i = it->second.first_position; i < it->second.end_position(); ++i) leave(it->second, i);
  DenseLine line = std::move(it->second);
  lines_.erase(it);
  return line;
}

void DenseLines::clear() {
  lines_.clear();
  cells_.clear();
}

void DenseLines::enter(DenseLine& line, std::int32_t position) {
  cells_[key_of(line.at(position).p)].push_back({line.id, position, &line, line.at(position).p});
}

void DenseLines::leave(const DenseLine& line, std::int32_t position) {
  const auto it = cells_.find(key_of(line.at(position).p));
  ENSURE(it != cells_.end());
  std::vector<Entry>& cell = it->second;
  const auto entry =
      std::ranges::find_if(cell, [&](const Entry& e) { return e.owner == &line && e.position == position; });
  ENSURE(entry != cell.end());
  *entry = cell.back();
  cell.pop_back();
}

DenseLine* DenseLines::find(LineId id) {
  const auto it = lines_.find(id);
  return it == lines_.end() ? nullptr : &it->second;
}

std::optional<DenseLines::Hit> DenseLines::nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                                                   const Gate& gate) const {
  // Segments are entered by their first vertex: the search reaches one segment further than its gate.
  const double reach_m = gate.distance_m + longest_segment_m_;
  std::optional<Hit> best;
  for (std::int64_t row = cell_of(point.y() - reach_m); row <= cell_of(point.y() + reach_m); ++row) {
    for (std::int64_t column = cell_of(point.x() - reach_m); column <= cell_of(point.x() + reach_m); ++column) {
      const auto cell = cells_.find(key_of(column, row));
      if (cell == cells_.end()) continue;
      for (const Entry& entry : cell->second) {
        if (entry.line == gate.except || (entry.p - point).squaredNorm() > reach_m * reach_m) continue;
        consider(entry, point, direction, gate, best);
      }
    }
  }
  return best;
}

void DenseLines::consider(const Entry& entry, const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                          const Gate& gate, std::optional<Hit>& best) const {
  const DenseLine& line = *entry.owner;
  if (entry.position + 1 >= line.end_position()) return;
  const Eigen::Vector2d step = line.at(entry.position + 1).p - entry.p;
  const double length2 = step.squaredNorm();
  if (length2 <= 0) return;
  const double cosine = direction.dot(step) / std::sqrt(length2);
  if ((gate.directed ? cosine : std::abs(cosine)) < gate.min_cos) return;
  const double raw = (point - entry.p).dot(step) / length2;
  constexpr double kRounding = 1e-9;
  const bool before_line = raw < -kRounding && entry.position == line.first_position;
  const bool behind_line = raw > 1 + kRounding && entry.position + 2 == line.end_position();
  if (before_line || behind_line) return;
  const double share = std::clamp(raw, 0.0, 1.0);
  const double distance_m = (point - entry.p - share * step).norm();
  if (distance_m > gate.distance_m) return;
  const auto order = [](const Hit& hit) { return std::tuple(hit.distance_m, hit.line, hit.position); };
  const Hit hit{entry.line, entry.position, share, distance_m};
  if (!best || order(hit) < order(*best)) best = hit;
}

}  // namespace roadvec
