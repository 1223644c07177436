#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "core/map/dense_lines.h"

namespace roadvec {

/// Which keyframes and which lines lie where, in squares of the map: what a keyframe that moved takes along is found
/// without a walk over the map. A few numbers per keyframe and line for each square that they touch.
class Footprints {
 public:
  void note_line(LineId line, const Eigen::Vector2d& p);
  void note_keyframe(std::uint64_t keyframe, const DenseLine& seen);
  /// The squares of what a keyframe saw, and those within `margin_m` of it, are stale until settle().
  void withdraw(std::uint64_t keyframe, const DenseLine& seen, double margin_m);
  void settle() { stale_.clear(); }

  [[nodiscard]] bool is_stale(const Eigen::Vector2d& p) const { return stale_.contains(square_of(p)); }
  /// In the stale squares: lines that are or were there, and keyframes that were not withdrawn.
  [[nodiscard]] std::set<LineId> stale_lines() const;
  [[nodiscard]] std::set<std::uint64_t> stale_keyframes() const;

 private:
  using Key = std::pair<std::int32_t, std::int32_t>;
  struct Square {
    std::vector<std::uint32_t> keyframes;
    std::vector<LineId> lines;
  };
  [[nodiscard]] static Key square_of(const Eigen::Vector2d& p);
  std::map<Key, Square> squares_;
  std::set<Key> stale_;
};

}  // namespace roadvec
