#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <string>

#include "core/map/vector_map.h"

namespace roadvec {

/// A map that grows, moves and shrinks as if a car drove along a winding road: changes with known truth for tests of
/// tiles, wire and server. The same seed tells the same story.
class MapStory {
 public:
  explicit MapStory(unsigned seed, std::int64_t merge_every = 17) : random_(seed), merge_every_(merge_every) {}

  [[nodiscard]] const VectorMap& map() const { return map_; }

  /// The next keyframe: both kerbs grow; now and then a line goes into another one, or a loop closes and everything
  /// moves.
  MapChange step() {
    ++step_;
    MapChange change;
    change.time.ns = 1'300'000'000'000'000'000 + step_ * 100'000'000;
    change.T_map_odom = T_map_odom_;
    for (const int side : {-1, 1}) grow(side, change);
    if (step_ % merge_every_ == 0) merge(change);
    if (step_ % 61 == 0) close_loop(change);
    return change;
  }

 private:
  static double mm(double m) { return std::round(m * 1000) / 1000.0; }
  double noise_m(double sigma_m) { return std::normal_distribution<double>(0, sigma_m)(random_); }

  void grow(int side, MapChange& change) {
    LineId& id = side < 0 ? right_ : left_;
    if (id == 0 || map_.at(id).vertices.size() > 60) {
      id = next_id_++;
      MapLine line;
      line.id = id;
      line.attributes.kind = static_cast<BoundaryKind>(id % 5);
      line.attributes.first_end = static_cast<EndKind>(id % 3);
      line.first_seen = change.time;
      map_.emplace(id, line);
    }
    MapLine& line = map_.at(id);
    const double s_m = 3.0 * static_cast<double>(step_), heading_rad = 0.8 * std::sin(s_m / 150);
    Vertex v;
    v.x_m = mm(s_m * std::cos(heading_rad) - side * 4 * std::sin(heading_rad) + noise_m(0.02));
    v.y_m = mm(-40 + s_m * std::sin(heading_rad) + side * 4 * std::cos(heading_rad) + noise_m(0.02));
    v.z_m = static_cast<float>(mm(noise_m(0.3)));
    v.height_m = static_cast<float>(mm(0.12 + noise_m(0.01)));
    v.sigma_across_m = static_cast<float>(mm(0.02 + std::abs(noise_m(0.01))));
    v.sigma_along_m = 0.5F;
    line.vertices.push_back(v);
    line.attributes.height_m = 0.12F;
    line.attributes.existence = static_cast<float>(mm(1 - 1.0 / static_cast<double>(line.vertices.size() + 1)));
    line.attributes.observation_count += 3;
    upsert(line, change);
  }

  void upsert(MapLine& line, MapChange& change) {
    ++line.revision;
    line.last_seen = change.time;
    if (std::find(change.upserted.begin(), change.upserted.end(), line.id) != change.upserted.end()) return;
    change.upserted.insert(std::upper_bound(change.upserted.begin(), change.upserted.end(), line.id), line.id);
  }

  void merge(MapChange& change) {
    const LineId oldest = map_.begin()->first;
    if (oldest == left_ || oldest == right_) return;
    map_.erase(oldest);
    change.removed.push_back(oldest);
    change.lineage.push_back({oldest, {left_}});
  }

  void close_loop(MapChange& change) {
    T_map_odom_ = Pose2{noise_m(0.5), noise_m(0.5), noise_m(0.002)} * T_map_odom_;
    change.closed_loop = true;
    change.T_map_odom = T_map_odom_;
    const double dx_m = mm(noise_m(0.5)), dy_m = mm(noise_m(0.5));
    for (auto& [id, line] : map_) {
      for (Vertex& v : line.vertices) {
        v.x_m = mm(v.x_m + dx_m);
        v.y_m = mm(v.y_m + dy_m);
      }
      upsert(line, change);
    }
  }

  std::mt19937 random_;
  std::int64_t merge_every_;
  std::int64_t step_ = 0;
  VectorMap map_;
  LineId next_id_ = 1, left_ = 0, right_ = 0;
  Pose2 T_map_odom_;
};

/// What is published of a map: coordinates in whole millimetres, all else as it is. Null when equal, else the first
/// difference.
inline std::optional<std::string> difference_between(const VectorMap& a, const VectorMap& b) {
  if (a.size() != b.size()) return std::to_string(a.size()) + " lines against " + std::to_string(b.size());
  for (auto i = a.begin(), j = b.begin(); i != a.end(); ++i, ++j) {
    const MapLine &l = i->second, &m = j->second;
    const std::string line = "line " + std::to_string(l.id);
    if (l.id != m.id || l.revision != m.revision) return line + ": id or revision";
    if (!(l.attributes == m.attributes)) return line + ": attributes";
    if (l.first_seen != m.first_seen || l.last_seen != m.last_seen) return line + ": times";
    if (l.vertices != m.vertices) return line + ": vertices";
  }
  return std::nullopt;
}

}  // namespace roadvec
