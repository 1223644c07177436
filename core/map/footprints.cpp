#include "core/map/footprints.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace roadvec {
namespace {

constexpr double kSquare_m = 16.0;  // choice: what is derived again needlessly beside what must be is half of that wide

}  // namespace

Footprints::Key Footprints::square_of(const Eigen::Vector2d& p) {
  return {static_cast<std::int32_t>(std::floor(p.x() / kSquare_m)),
          static_cast<std::int32_t>(std::floor(p.y() / kSquare_m))};
}

void Footprints::note_line(LineId line, const Eigen::Vector2d& p) {
  std::vector<LineId>& lines = squares_[square_of(p)].lines;
  if (std::ranges::find(lines, line) == lines.end()) lines.push_back(line);
}

void Footprints::note_keyframe(std::uint64_t keyframe, const DenseLine& seen) {
  const auto number = static_cast<std::uint32_t>(keyframe);
  std::optional<Key> last;
  for (const DenseVertex& vertex : seen.vertices) {
    const Key key = square_of(vertex.p);
    if (last == key) continue;
    last = key;
    std::vector<std::uint32_t>& keyframes = squares_[key].keyframes;
    if (std::ranges::find(keyframes, number) == keyframes.end()) keyframes.push_back(number);
  }
}

void Footprints::withdraw(std::uint64_t keyframe, const DenseLine& seen, double margin_m) {
  for (const DenseVertex& vertex : seen.vertices) {
    for (const double dx : {-margin_m, margin_m}) {
      for (const double dy : {-margin_m, margin_m}) stale_.insert(square_of(vertex.p + Eigen::Vector2d(dx, dy)));
    }
    const auto square = squares_.find(square_of(vertex.p));
    if (square != squares_.end()) std::erase(square->second.keyframes, static_cast<std::uint32_t>(keyframe));
  }
}

std::set<LineId> Footprints::stale_lines() const {
  std::set<LineId> lines;
  for (const Key& key : stale_) {
    const auto square = squares_.find(key);
    if (square != squares_.end()) lines.insert(square->second.lines.begin(), square->second.lines.end());
  }
  return lines;
}

std::set<std::uint64_t> Footprints::stale_keyframes() const {
  std::set<std::uint64_t> keyframes;
  for (const Key& key : stale_) {
    const auto square = squares_.find(key);
    if (square != squares_.end()) keyframes.insert(square->second.keyframes.begin(), square->second.keyframes.end());
  }
  return keyframes;
}

}  // namespace roadvec
