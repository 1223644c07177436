#include "core/boundary/simplify.h"

#include "core/geometry/segment.h"

namespace roadvec {
namespace {

struct Farthest {
  std::uint32_t index = 0;
  double distance2_m2 = -1;
};

Farthest farthest_between(std::span<const Vertex> line, std::uint32_t first, std::uint32_t last) {
  const Segment chord{line[first].position(), line[last].position()};
  Farthest farthest{first, -1};
  for (std::uint32_t i = first + 1; i < last; ++i) {
    const double d2 = chord.distance2_m2(line[i].position());
    if (d2 > farthest.distance2_m2) farthest = {i, d2};
  }
  return farthest;
}

}  // namespace

Simplifier::Simplifier(const SimplifyConfig& config) : config_(config) {
  constexpr std::size_t kVertices = 7200;  // a ray each
  open_.reserve(kVertices);
  kept_.reserve(kVertices);
  simplified_.reserve(kVertices, kVertices / 2);
}

const std::vector<std::uint32_t>& Simplifier::kept(std::span<const Vertex> line) {
  kept_.clear();
  if (line.empty()) return kept_;
  kept_.push_back(0);
  if (line.size() == 1) return kept_;
  open_.clear();
  open_.emplace_back(0U, static_cast<std::uint32_t>(line.size() - 1));
  while (!open_.empty()) {
    const auto [first, last] = open_.back();
    open_.pop_back();
    const Farthest split = farthest_between(line, first, last);
    if (split.distance2_m2 <= config_.tolerance_m * config_.tolerance_m) {
      kept_.push_back(last);
    } else {
      // The half nearer the start goes on top, so that kept vertices come out in order.
      open_.emplace_back(split.index, last);
      open_.emplace_back(first, split.index);
    }
  }
  return kept_;
}

const LineSet& Simplifier::run_all(const LineSet& lines) {
  simplified_.clear();
  for (const LineSet::Line& line : lines.lines()) {
    const std::span<const Vertex> vertices = lines.vertices_of(line);
    simplified_.begin_line(line.attributes);
    for (const std::uint32_t index : kept(vertices)) simplified_.push_vertex(vertices[index]);
  }
  return simplified_;
}

}  // namespace roadvec
