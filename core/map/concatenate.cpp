#include "core/map/concatenate.h"

#include <algorithm>
#include <cmath>

#include "core/base/square.h"
#include "core/geometry/segment.h"

namespace roadvec {
namespace {

// Between gate and 1.6 gate a sample neither updates a line nor starts one: what straddles the gate makes no
// duplicates.
constexpr double kLabelGates = 1.6;
constexpr double kDuplicateGates = 0.7;  // narrower than the gate, so that what was just kept apart is not joined again
constexpr double kDuplicateOverlap_m = 2.0;
// Ids: keyframe + 1 above, then 12 bits of line in the keyframe, 4 bits of piece. The top quarter of lines are spare
// ids.
constexpr unsigned kKeyframeShift = 16, kLineShift = 4;
constexpr LineId kPieces = 1U << kLineShift;
constexpr LineId kFirstSpareId = 0xC000, kMostLines = kFirstSpareId >> kLineShift;

LineId prefix_of(std::uint64_t keyframe, LineId line) {
  return ((keyframe + 1) << kKeyframeShift) | (line << kLineShift);
}
template <class Vertices>
double length_between_m(const Vertices& vertices, std::size_t first, std::size_t last) {
  double sum_m = 0;
  for (std::size_t i = first; i < last; ++i) sum_m += (vertices[i + 1].p - vertices[i].p).norm();
  return sum_m;
}

DenseVertex between(const DenseVertex& a, const DenseVertex& b, double share) {
  DenseVertex v = a;
  const auto part = static_cast<float>(share);
  v.p = a.p + share * (b.p - a.p);
  v.weight = a.weight + share * (b.weight - a.weight);
  v.z_m = a.z_m + part * (b.z_m - a.z_m);
  v.height_m = a.height_m + part * (b.height_m - a.height_m);
  v.sigma_along_m = a.sigma_along_m + part * (b.sigma_along_m - a.sigma_along_m);
  return v;
}

/// An end that was seen to be open or occluded says more than one that was merely not seen further.
void settle(EndKind& end, EndKind seen) {
  if (seen != EndKind::unseen || end == EndKind::unseen) end = seen;
}

}  // namespace

Concatenator::Concatenator(const ConcatenateConfig& config)
    : config_(config),
      min_cos_(std::cos(rad_from_deg(config.angle_gate_deg))),
      lines_(config.vertex_spacing_m),
      publisher_(config.publish),
      incoming_index_(kIndexCell_m) {}

void Concatenator::add(std::uint64_t keyframe, SensorTime time, const LineSet& lvm_vehicle,
                       const Pose2& T_map_vehicle) {
  keyframe_ = keyframe;
  time_ = time;
  again_ = !withdrawn_.empty() && !withdrawn_.contains(keyframe);
  next_spare_id_ = prefix_of(keyframe, 0) | kFirstSpareId;
  std::set<LineId> touched_by_keyframe;
  const std::size_t line_count = std::min<std::size_t>(lvm_vehicle.lines().size(), kMostLines);
  for (std::size_t l = 0; l < line_count; ++l) {
    DenseLine incoming = incoming_line(lvm_vehicle, lvm_vehicle.lines()[l], T_map_vehicle);
    if (incoming.vertices.size() < 2) continue;
    incoming.id = prefix_of(keyframe, l);
    touched_now_.clear();
    if (again_) {
      for (const DenseLine& part : stale_parts(incoming)) merge_in(part, false);
    } else {
      footprints_.note_keyframe(keyframe, incoming);
      merge_in(incoming, false);
    }
    remember_successors(incoming.id, touched_now_);
    touched_by_keyframe.insert(touched_now_.begin(), touched_now_.end());
  }
  touched_now_ = std::move(touched_by_keyframe);
  absorb_duplicates();
  touched_.insert(touched_now_.begin(), touched_now_.end());
}

void Concatenator::publish(bool everything, MapChange& change) {
  std::set<LineId> ids = std::move(touched_);
  touched_.clear();
  if (everything) {
    for (const auto& [id, line] : lines_.all()) ids.insert(id);
    for (const auto& [id, line] : publisher_.map()) ids.insert(id);
  }
  std::map<LineId, std::vector<LineId>> successors;
  for (const LineId id : ids) {
    if (lines_.find(id) != nullptr) continue;
    std::set<LineId> heirs;
    if (absorbed_by_.contains(id)) heirs.insert(survivor_of(id));
    if (const auto known = successors_.find(id); known != successors_.end()) {
      for (const LineId heir : known->second) heirs.insert(survivor_of(heir));
    }
    successors[id].assign(heirs.begin(), heirs.end());
  }
  publisher_.run(lines_, ids, successors, everything, change);
  successors_.clear();
}

DenseLine Concatenator::incoming_line(const LineSet& lvm, const LineSet::Line& line, const Pose2& T_map_vehicle) const {
  DenseLine incoming;
  incoming.first_end = line.attributes.first_end;
  incoming.last_end = line.attributes.last_end;
  incoming.observation_count = line.attributes.observation_count;
  incoming.existence_weight = std::max(1U, line.attributes.observation_count);
  incoming.existence_sum = incoming.existence_weight * static_cast<double>(line.attributes.existence);
  incoming.keyframe_count = 1;
  incoming.last_keyframe = keyframe_;
  incoming.first_seen = incoming.last_seen = time_;
  double length_m = 0;
  for (const Vertex& vertex : lvm.vertices_of(line)) {
    DenseVertex next;
    next.p = T_map_vehicle * vertex.position();
    next.weight = 1.0 / square(std::max(static_cast<double>(vertex.sigma_across_m), config_.min_sigma_m));
    next.z_m = vertex.z_m;
    next.height_m = vertex.height_m;
    next.sigma_along_m = vertex.sigma_along_m;
    next.last_keyframe = keyframe_;
    if (!incoming.vertices.empty()) {
      const DenseVertex previous = incoming.vertices.back();
      const double step_m = (next.p - previous.p).norm();
      if (step_m <= 0) continue;
      const double piece_count = std::ceil(step_m / config_.vertex_spacing_m);
      for (double k = 1; k < piece_count; ++k) incoming.vertices.push_back(between(previous, next, k / piece_count));
      length_m += step_m;
    }
    incoming.vertices.push_back(next);
  }
  incoming.kind_votes_m[static_cast<std::size_t>(line.attributes.kind)] = length_m;
  return incoming;
}

/// `absorbing`: the incoming line comes from the map itself, not from a keyframe.
void Concatenator::merge_in(const DenseLine& incoming, bool absorbing) {
  index_incoming(incoming);
  label(incoming);
  update(incoming, absorbing);
  settle_ends(incoming);
  connect(incoming);
}

void Concatenator::index_incoming(const DenseLine& incoming) {
  incoming_lines_.clear();
  incoming_lines_.begin_line({});
  for (const DenseVertex& v : incoming.vertices) {
    incoming_lines_.push_vertex(
        {v.p.x(), v.p.y(), v.z_m, v.height_m, static_cast<float>(1.0 / std::sqrt(v.weight)), v.sigma_along_m});
  }
  incoming_index_.build(incoming_lines_);
}

/// The line that each vertex lies on, in runs. A short hole within one line's run is no hole.
void Concatenator::label(const DenseLine& incoming) {
  const std::size_t count = incoming.vertices.size();
  hits_.assign(count, std::nullopt);
  const DenseLines::Gate gate{kLabelGates * config_.gate_m, min_cos_, config_.directed, 0};
  for (std::size_t i = 0; i < count; ++i) {
    hits_[i] = lines_.nearest(incoming.vertices[i].p, incoming.direction_at(static_cast<std::int32_t>(i)), gate);
  }
  runs_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const LineId line = hits_[i] ? hits_[i]->line : 0;
    if (runs_.empty() || runs_.back().line != line) runs_.push_back({line, i, i});
    runs_.back().last = i;
    const bool closes_hole = runs_.size() >= 3 && runs_.back().line == runs_[runs_.size() - 3].line &&
                             length_between_m(incoming.vertices, runs_[runs_.size() - 3].last, i) < config_.min_piece_m;
    if (closes_hole) {
      runs_.resize(runs_.size() - 2);
      runs_.back().last = i;
    }
  }
}

void Concatenator::update(const DenseLine& incoming, bool absorbing) {
  const double whole_m = length_between_m(incoming.vertices, 0, incoming.vertices.size() - 1);
  for (const Run& run : runs_) {
    if (run.line == 0) continue;
    DenseLine* line = lines_.find(run.line);
    std::int32_t from = line->end_position(), to = line->first_position - 1;
    for (std::size_t i = run.first; i <= run.last; ++i) {
      if (!hits_[i] || hits_[i]->line != run.line) continue;
      from = std::min(from, hits_[i]->position);
      to = std::max(to, hits_[i]->position + 1);
    }
    update_vertices(*line, from, to, absorbing);
    add_evidence(*line, incoming, length_between_m(incoming.vertices, run.first, run.last) / whole_m, absorbing);
    touched_now_.insert(run.line);
  }
}

/// Weighted mean of vertex and observation, across the line only: along it neither says where the other's vertices are.
void Concatenator::update_vertices(DenseLine& line, std::int32_t from, std::int32_t to, bool absorbing) {
  const SegmentIndex::Gate gate{config_.gate_m, min_cos_, config_.directed};
  const double heaviest = 1.0 / square(config_.min_sigma_m);
  for (std::int32_t i = from; i <= to; ++i) {
    DenseVertex& vertex = line.at(i);
    if (vertex.last_keyframe == keyframe_ && !absorbing) continue;
    if (again_ && !footprints_.is_stale(vertex.p)) continue;
    const Eigen::Vector2d direction = line.direction_at(i);
    const auto hit = incoming_index_.nearest(vertex.p, direction, gate);
    if (!hit || hit->overshoot_m > 0) continue;
    const SegmentIndex::Item& item = incoming_index_.items()[hit->item];
    const Eigen::Vector2d foot = item.a + hit->along_m * item.direction;
    const double weight = 1.0 / std::max(item.variance_at(hit->along_m), square(config_.min_sigma_m));
    const double share = weight / (vertex.weight + weight);
    const Eigen::Vector2d normal(-direction.y(), direction.x());
    const Vertex& seen = incoming_lines_.vertices()[hit->item];
    vertex.z_m += static_cast<float>(share) * (seen.z_m - vertex.z_m);
    vertex.height_m += static_cast<float>(share) * (seen.height_m - vertex.height_m);
    vertex.sigma_along_m += static_cast<float>(share) * (seen.sigma_along_m - vertex.sigma_along_m);
    vertex.weight = std::min(heaviest, vertex.weight + weight);
    vertex.last_keyframe = keyframe_;
    lines_.move(line, i, vertex.p + share * normal.dot(foot - vertex.p) * normal);
  }
}

/// Of two lines of the map, the counts of the one seen more often hold for both: their keyframes are mostly the same.
void Concatenator::add_evidence(DenseLine& line, const DenseLine& incoming, double share, bool absorbing) const {
  for (std::size_t kind = 0; kind < line.kind_votes_m.size(); ++kind) {
    line.kind_votes_m[kind] += share * incoming.kind_votes_m[kind];
  }
  line.existence_sum += share * incoming.existence_sum;
  line.existence_weight += share * incoming.existence_weight;
  line.first_seen = line.keyframe_count == 0 ? incoming.first_seen : std::min(line.first_seen, incoming.first_seen);
  line.last_seen = std::max(line.last_seen, incoming.last_seen);
  if (absorbing) {
    line.observation_count = std::max(line.observation_count, incoming.observation_count);
    line.keyframe_count = std::max(line.keyframe_count, incoming.keyframe_count);
  }
  if (absorbing || (line.keyframe_count > 0 && line.last_keyframe >= incoming.last_keyframe)) return;
  line.observation_count += incoming.observation_count;
  line.keyframe_count += incoming.keyframe_count;
  line.last_keyframe = incoming.last_keyframe;
}

void Concatenator::settle_ends(const DenseLine& incoming) {
  const Run first = runs_.front(), last = runs_.back();
  if (first.line != 0 && leaves_at(first.line, End::first, incoming.vertices.front())) {
    settle(lines_.find(first.line)->first_end, incoming.first_end);
  }
  if (last.line != 0 && leaves_at(last.line, End::last, incoming.vertices.back())) {
    settle(lines_.find(last.line)->last_end, incoming.last_end);
  }
}

/// Walks along the incoming line and connects what it shows to be one boundary.
void Concatenator::connect(const DenseLine& incoming) {
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const LineId before = r > 0 ? survivor_of(runs_[r - 1].line) : 0;
    if (runs_[r].line == 0) {
      const LineId after = r + 1 < runs_.size() ? survivor_of(runs_[r + 1].line) : 0;
      place_free_run(incoming, runs_[r], before, after);
    } else if (before != 0 && before != survivor_of(runs_[r].line)) {
      const LineId after = survivor_of(runs_[r].line);
      const bool end_to_end = leaves_at(before, End::last, incoming.vertices[runs_[r].first - 1]) &&
                              leaves_at(after, End::first, incoming.vertices[runs_[r].first]);
      if (end_to_end && meet(before, after)) join(before, after);
    }
  }
}

/// A stretch on no line: what follows the end of one, leads to the beginning of the next, both, or neither.
void Concatenator::place_free_run(const DenseLine& incoming, const Run& run, LineId before, LineId after) {
  const bool follows = before != 0 && leaves_at(before, End::last, incoming.vertices[run.first - 1]) &&
                       goes_on(*lines_.find(before), End::last, incoming, run.first, run.last);
  const bool leads = after != 0 && leaves_at(after, End::first, incoming.vertices[run.last + 1]) &&
                     goes_on(*lines_.find(after), End::first, incoming, run.first, run.last);
  if (follows) {
    DenseLine& line = *lines_.find(before);
    extend(line, End::last, incoming, run.first, run.last);
    if (leads && before != after && meet(before, after)) {
      join(before, after);
    } else {
      line.last_end = run.last + 1 == incoming.vertices.size() ? incoming.last_end : EndKind::unseen;
    }
  } else if (leads) {
    DenseLine& line = *lines_.find(after);
    extend(line, End::first, incoming, run.first, run.last);
    line.first_end = run.first == 0 ? incoming.first_end : EndKind::unseen;
  } else if (length_between_m(incoming.vertices, run.first, run.last) >= config_.min_piece_m) {
    start_line(incoming, run);
  }
}

/// How many of the vertices [first, last] of `from`, outwards, still lie along `line` and not yet beyond its end.
std::size_t Concatenator::count_along(const DenseLine& line, End end, const DenseLine& from, std::size_t first,
                                      std::size_t last) const {
  const bool forwards = end == End::last;
  const auto from_tip = [&](std::size_t i) { return line.vertices[forwards ? line.vertices.size() - 1 - i : i].p; };
  const Eigen::Vector2d along = line.direction_at(forwards ? line.end_position() - 1 : line.first_position);
  const Eigen::Vector2d outwards = forwards ? along : Eigen::Vector2d(-along);
  const auto is_along = [&](const Eigen::Vector2d& p, std::size_t reach) {
    if ((p - from_tip(0)).dot(outwards) > 0.25 * config_.vertex_spacing_m) return false;
    for (std::size_t i = 0; i + 1 < std::min(line.vertices.size(), reach); ++i) {
      if (Segment{from_tip(i), from_tip(i + 1)}.distance2_m2(p) <= square(config_.gate_m)) return true;
    }
    return false;
  };
  const auto wandering = static_cast<std::size_t>(2 * config_.end_gate_m / config_.vertex_spacing_m);
  std::size_t count = 0;
  while (count <= last - first && is_along(from.vertices[forwards ? first + count : last - count].p, count + wandering))
    ++count;
  return count;
}

/// Whether the vertices [first, last] of `from` go on where `line` ends. Else they are another boundary, and a line to
/// it would be drawn across what nobody saw.
bool Concatenator::goes_on(const DenseLine& line, End end, const DenseLine& from, std::size_t first,
                           std::size_t last) const {
  const std::size_t along = count_along(line, end, from, first, last);
  if (along > last - first) return true;
  const bool forwards = end == End::last;
  const DenseVertex& tip = forwards ? line.vertices.back() : line.vertices.front();
  return (from.vertices[forwards ? first + along : last - along].p - tip.p).norm() <= config_.end_gate_m;
}

/// Whether the end of `first` and the beginning of `second` are one place.
bool Concatenator::meet(LineId first, LineId second) const {
  const DenseLine& line = lines_.all().at(std::min(first, second));
  const DenseLine& other = lines_.all().at(std::max(first, second));
  return goes_on(line, line.id == first ? End::last : End::first, other, 0, other.vertices.size() - 1);
}

/// Adds the vertices [first, last] of `from` to an end of `line`, outwards; those that still lie along it are left out.
void Concatenator::extend(DenseLine& line, End end, const DenseLine& from, std::size_t first, std::size_t last) {
  const bool forwards = end == End::last;
  for (std::size_t k = count_along(line, end, from, first, last); k <= last - first; ++k) {
    const DenseVertex& next = from.vertices[forwards ? first + k : last - k];
    const DenseVertex tip = forwards ? line.vertices.back() : line.vertices.front();
    const Eigen::Vector2d step = next.p - tip.p;
    const double piece_count = std::max(1.0, std::ceil(step.norm() / config_.vertex_spacing_m));
    for (double piece = 1; piece <= piece_count; ++piece) {
      DenseVertex vertex = piece < piece_count ? between(tip, next, piece / piece_count) : next;
      vertex.is_published = false;
      footprints_.note_line(line.id, vertex.p);
      if (forwards) {
        lines_.append(line, vertex);
      } else {
        lines_.prepend(line, vertex);
      }
    }
  }
}

void Concatenator::start_line(const DenseLine& incoming, const Run& run) {
  // A line of the map that falls into pieces keeps its id for the first; ids once given are never given again.
  LineId id = incoming.id;
  const LineId end = id % kPieces == 0 && id >= prefix_of(keyframe_, 0) ? id + kPieces : id + 1;
  while (id < end && lines_.find(id) != nullptr) ++id;
  if (id == end) id = spare_id();
  absorbed_by_.erase(id);
  DenseLine& line = lines_.create(id);
  for (std::size_t i = run.first; i <= run.last; ++i) {
    footprints_.note_line(id, incoming.vertices[i].p);
    lines_.append(line, incoming.vertices[i]);
  }
  const double whole_m = length_between_m(incoming.vertices, 0, incoming.vertices.size() - 1);
  add_evidence(line, incoming, length_between_m(incoming.vertices, run.first, run.last) / whole_m, false);
  line.first_end = run.first == 0 ? incoming.first_end : EndKind::unseen;
  line.last_end = run.last + 1 == incoming.vertices.size() ? incoming.last_end : EndKind::unseen;
  touched_now_.insert(id);
}

/// `second` continues `first`: one line from now on, under the smaller id.
void Concatenator::join(LineId first, LineId second) {
  const LineId stays = std::min(first, second), goes = std::max(first, second);
  const DenseLine gone = lines_.take(goes);
  DenseLine& line = *lines_.find(stays);
  extend(line, stays == first ? End::last : End::first, gone, 0, gone.vertices.size() - 1);
  if (stays == first) {
    line.last_end = gone.last_end;
  } else {
    line.first_end = gone.first_end;
  }
  add_evidence(line, gone, 1.0, true);
  absorbed_by_[goes] = stays;
  touched_now_.insert(goes);
  touched_now_.insert(stays);
}

bool Concatenator::leaves_at(LineId id, End end, const DenseVertex& vertex) const {
  const DenseLine& line = lines_.all().at(id);
  const Eigen::Vector2d& tip = end == End::last ? line.vertices.back().p : line.vertices.front().p;
  return (tip - vertex.p).norm() <= config_.end_gate_m;
}

LineId Concatenator::survivor_of(LineId id) const {
  for (auto it = absorbed_by_.find(id); it != absorbed_by_.end(); it = absorbed_by_.find(id)) id = it->second;
  return id;
}

/// Two lines that came to lie on each other are one: the younger is merged into the older like an observation.
void Concatenator::absorb_duplicates() {
  std::set<LineId> open = touched_now_;
  while (!open.empty()) {
    const LineId id = *open.begin();
    open.erase(open.begin());
    const DenseLine* line = lines_.find(id);
    const LineId other = line != nullptr ? duplicate_of(*line) : 0;
    if (other == 0) continue;
    const LineId stays = std::min(id, other), goes = std::max(id, other);
    const DenseLine gone = lines_.take(goes);
    touched_now_.insert({stays, goes});
    merge_in(gone, true);
    if (lines_.find(goes) == nullptr) absorbed_by_[goes] = stays;
  }
}

/// Another line on which `line` lies for some metres, judged by what this keyframe moved.
LineId Concatenator::duplicate_of(const DenseLine& line) const {
  std::map<LineId, double> overlap_m;
  const DenseLines::Gate gate{kDuplicateGates * config_.gate_m, min_cos_, config_.directed, line.id};
  for (std::int32_t i = line.first_position; i + 1 < line.end_position(); i += 2) {
    if (line.at(i).last_keyframe != keyframe_) continue;
    const auto hit = lines_.nearest(line.at(i).p, line.direction_at(i), gate);
    if (!hit) continue;
    double& sum_m = overlap_m[hit->line];
    sum_m += 2.0 * (line.at(i + 1).p - line.at(i).p).norm();
    if (sum_m >= kDuplicateOverlap_m) return hit->line;
  }
  return 0;
}

/// When the map is derived again, a published line may not come about: the lines that its first observation now lies on
/// take its place.
void Concatenator::remember_successors(LineId prefix, const std::set<LineId>& touched) {
  if (touched.empty()) return;
  const VectorMap& published = publisher_.map();
  for (auto it = published.lower_bound(prefix); it != published.end() && it->first < prefix + kPieces; ++it) {
    if (lines_.find(it->first) == nullptr) successors_[it->first].insert(touched.begin(), touched.end());
  }
}

}  // namespace roadvec
