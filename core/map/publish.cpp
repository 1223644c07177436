#include "core/map/publish.h"

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

// Anchors: every 64 vertices of half a metre, the side of half a tile.
constexpr std::int32_t kPieceVertices = 64;
constexpr float kHeightStep_m = 0.03F;  // smaller changes of height or existence are no news
constexpr float kExistenceStep = 0.1F;

double whole_millimetres(double value_m) { return std::round(value_m * 1000.0) / 1000.0; }
float whole_millimetres(float value_m) { return std::round(value_m * 1000.0F) / 1000.0F; }

/// Last position of the piece that begins at `from`: the next anchor, or the line's end.
std::int32_t piece_end(const DenseLine& line, std::int32_t from) {
  const std::int32_t into = ((from % kPieceVertices) + kPieceVertices) % kPieceVertices;
  return std::min(line.end_position() - 1, from - into + kPieceVertices);
}

BoundaryKind most_voted(const DenseLine& line) {
  std::size_t best = 0;
  // `unknown` (0) wins only where nothing else was ever seen.
  for (std::size_t kind = 1; kind < line.kind_votes_m.size(); ++kind) {
    if (line.kind_votes_m[kind] > (best == 0 ? 0.0 : line.kind_votes_m[best])) best = kind;
  }
  return static_cast<BoundaryKind>(best);
}

float median_height_m(const DenseLine& line) {
  std::vector<float> heights;
  heights.reserve(line.vertices.size());
  for (const DenseVertex& vertex : line.vertices) heights.push_back(vertex.height_m);
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  return whole_millimetres(*middle);
}

LineAttributes attributes_of(const DenseLine& line) {
  LineAttributes attributes;
  attributes.kind = most_voted(line);
  attributes.first_end = line.first_end;
  attributes.last_end = line.last_end;
  attributes.height_m = median_height_m(line);
  const double existence = line.existence_weight > 0 ? line.existence_sum / line.existence_weight : 0.0;
  attributes.existence = static_cast<float>(std::round(existence * 100.0) / 100.0);
  attributes.observation_count =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(line.observation_count, UINT32_MAX));
  return attributes;
}

bool news(const LineAttributes& now, const LineAttributes& before) {
  return now.kind != before.kind || now.first_end != before.first_end || now.last_end != before.last_end ||
         std::abs(now.height_m - before.height_m) > kHeightStep_m ||
         std::abs(now.existence - before.existence) > kExistenceStep;
}

bool moved(const DenseVertex& vertex, double shift_m) {
  return !vertex.is_published || (vertex.p - vertex.published).squaredNorm() > shift_m * shift_m;
}

Vertex published_vertex(const DenseVertex& v) {
  return {v.published.x(),
          v.published.y(),
          whole_millimetres(v.z_m),
          whole_millimetres(v.height_m),
          whole_millimetres(static_cast<float>(1.0 / std::sqrt(v.weight))),
          whole_millimetres(v.sigma_along_m)};
}

bool same_content(const MapLine& a, const MapLine& b) {
  return a.attributes == b.attributes && a.first_seen == b.first_seen && a.last_seen == b.last_seen &&
         a.vertices == b.vertices;
}

}  // namespace

bool LinePublisher::qualifies(const DenseLine& line) const {
  if (line.keyframe_count < static_cast<std::uint64_t>(config_.min_keyframe_count)) return false;
  double length_m = 0;
  for (std::int32_t i = line.first_position; i + 1 < line.end_position(); ++i) {
    length_m += (line.at(i + 1).p - line.at(i).p).norm();
    if (length_m >= config_.min_length_m) return true;  // a long line need not be walked to its end
  }
  return false;
}

bool LinePublisher::worth_publishing(const DenseLine& line) const {
  const auto published = map_.find(line.id);
  if (published == map_.end() || news(attributes_of(line), published->second.attributes)) return true;
  double growth_m = 0;
  for (std::int32_t i = line.first_position; i < line.end_position(); ++i) {
    const DenseVertex& vertex = line.at(i);
    if (!vertex.is_published) {
      growth_m += (line.at(std::max(line.first_position, i - 1)).p - vertex.p).norm();
      if (growth_m > config_.growth_m) return true;
    } else if (moved(vertex, config_.shift_m)) {
      return true;
    }
  }
  return false;
}

void LinePublisher::refresh(DenseLine& line, bool everything) const {
  for (std::int32_t from = line.first_position; from + 1 < line.end_position(); from = piece_end(line, from)) {
    const std::int32_t to = piece_end(line, from);
    bool stale = everything;
    for (std::int32_t i = from; i <= to && !stale; ++i) stale = moved(line.at(i), config_.shift_m);
    for (std::int32_t i = from; i <= to && stale; ++i) {
      line.at(i).published = line.at(i).p;
      line.at(i).is_published = true;
    }
  }
}

/// Least squares over the dropped vertices, one kept vertex at a time with its neighbours held: moving it by h along
/// its normal m moves the line at a dropped vertex by h * t * (m . n), t its share of the way from the other end. The
/// piece's ends are anchors and stay.
void LinePublisher::fit(const std::vector<std::uint32_t>& kept) {
  fitted_.clear();
  for (const std::uint32_t k : kept) fitted_.push_back(piece_[k].position());
  constexpr int kSweeps = 3;  // choice: what is left after them is far below a millimetre times the noise
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t j = 1; j + 1 < kept.size(); ++j) {
      const Eigen::Vector2d chord = (fitted_[j + 1] - fitted_[j - 1]).normalized();
      const Eigen::Vector2d normal(-chord.y(), chord.x());
      double product = 0, squares = 0;
      for (const std::size_t other : {j - 1, j + 1}) {
        const Eigen::Vector2d away = fitted_[other] - fitted_[j];
        const double length2 = away.squaredNorm();
        const Eigen::Vector2d n = Eigen::Vector2d(-away.y(), away.x()) / std::sqrt(length2);
        const auto [from, to] = std::minmax(kept[j], kept[other]);
        for (std::uint32_t i = from; i <= to; ++i) {
          const Eigen::Vector2d offset = piece_[i].position() - fitted_[j];
          const double effect = (1.0 - std::clamp(offset.dot(away) / length2, 0.0, 1.0)) * normal.dot(n);
          product += effect * n.dot(offset);
          squares += effect * effect;
        }
      }
      if (squares > 0) fitted_[j] += std::clamp(product / squares, -config_.tolerance_m, config_.tolerance_m) * normal;
    }
  }
}

MapLine LinePublisher::make(const DenseLine& line) {
  MapLine made{.id = line.id,
               .revision = 1,
               .attributes = attributes_of(line),
               .first_seen = line.first_seen,
               .last_seen = line.last_seen,
               .vertices = {}};
  for (std::int32_t from = line.first_position; from + 1 < line.end_position(); from = piece_end(line, from)) {
    piece_.clear();
    for (std::int32_t i = from; i <= piece_end(line, from); ++i) piece_.push_back(published_vertex(line.at(i)));
    const std::vector<std::uint32_t>& kept = simplifier_.kept(piece_);
    fit(kept);
    for (std::size_t j = made.vertices.empty() ? 0 : 1; j < kept.size(); ++j) {
      Vertex vertex = piece_[kept[j]];
      vertex.x_m = whole_millimetres(fitted_[j].x());
      vertex.y_m = whole_millimetres(fitted_[j].y());
      made.vertices.push_back(vertex);
    }
  }
  return made;
}

void LinePublisher::upsert(MapLine&& line, MapChange& change) {
  const auto published = map_.find(line.id);
  if (published != map_.end()) {
    if (same_content(published->second, line)) return;
    line.revision = published->second.revision + 1;
  } else if (const auto retired = retired_revisions_.find(line.id); retired != retired_revisions_.end()) {
    line.revision = retired->second + 1;
    retired_revisions_.erase(retired);
  }
  change.upserted.push_back(line.id);
  map_.insert_or_assign(line.id, std::move(line));
}

void LinePublisher::remove(LineId id, const std::map<LineId, std::vector<LineId>>& successors, MapChange& change) {
  const auto published = map_.find(id);
  if (published == map_.end()) return;
  retired_revisions_[id] = published->second.revision;
  map_.erase(published);
  change.removed.push_back(id);
  const auto known = successors.find(id);
  change.lineage.push_back({id, known == successors.end() ? std::vector<LineId>{} : known->second});
}

void LinePublisher::run(DenseLines& lines, const std::set<LineId>& ids,
                        const std::map<LineId, std::vector<LineId>>& successors, bool everything, MapChange& change) {
  for (const LineId id : ids) {
    DenseLine* line = lines.find(id);
    if (line == nullptr || !qualifies(*line)) {
      remove(id, successors, change);
    } else if (everything || worth_publishing(*line)) {
      refresh(*line, everything);
      upsert(make(*line), change);
    }
  }
  // Only lines that clients know can be named to them.
  for (Lineage& lineage : change.lineage) {
    std::erase_if(lineage.successors, [&](LineId id) { return !map_.contains(id); });
  }
}

}  // namespace roadvec
