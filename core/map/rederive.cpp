// Step 9, concatenate: what a closure moved is derived again, and nothing else.
#include <algorithm>

#include "core/map/concatenate.h"

namespace roadvec {
namespace {

// On both sides of a stale stretch, so that it finds the lines it goes on from.
constexpr std::size_t kOverlapVertices = 4;

}  // namespace

void Concatenator::withdraw(std::uint64_t keyframe, const LineSet& lvm_vehicle, const Pose2& T_map_vehicle) {
  withdrawn_.insert(keyframe);
  for (const LineSet::Line& line : lvm_vehicle.lines()) {
    footprints_.withdraw(keyframe, incoming_line(lvm_vehicle, line, T_map_vehicle), config_.gate_m);
  }
}

std::set<std::uint64_t> Concatenator::forget() {
  for (const LineId id : footprints_.stale_lines()) {
    if (lines_.find(id) != nullptr) cut(id);
  }
  return footprints_.stale_keyframes();
}

void Concatenator::end_withdrawal() {
  footprints_.settle();
  withdrawn_.clear();
}

/// Leaves of a line what lies outside the stale squares. The first piece keeps the id; when the others grow together
/// with it again, that is the smaller id and stays.
void Concatenator::cut(LineId id) {
  DenseLine whole = lines_.take(id);
  touched_.insert(id);
  std::deque<DenseVertex> vertices;
  vertices.swap(whole.vertices);
  const auto is_stale = [&](const DenseVertex& vertex) { return footprints_.is_stale(vertex.p); };
  for (auto from = vertices.begin(); from != vertices.end();) {
    from = std::find_if_not(from, vertices.end(), is_stale);
    const auto to = std::find_if(from, vertices.end(), is_stale);
    const auto count = to - from;
    if (count >= 2) {
      const LineId piece_id = lines_.find(id) == nullptr ? id : spare_id();
      DenseLine& piece = lines_.create(piece_id);
      const double share = static_cast<double>(count) / static_cast<double>(vertices.size());
      piece = whole;
      piece.id = piece_id;
      piece.first_position = whole.first_position + static_cast<std::int32_t>(from - vertices.begin());
      if (from != vertices.begin()) piece.first_end = EndKind::unseen;
      if (to != vertices.end()) piece.last_end = EndKind::unseen;
      for (double& votes_m : piece.kind_votes_m) votes_m *= share;
      piece.existence_sum *= share;
      piece.existence_weight *= share;
      for (auto vertex = from; vertex != to; ++vertex) lines_.append(piece, *vertex);
      for (auto vertex = from; vertex != to; ++vertex) footprints_.note_line(piece_id, vertex->p);
      touched_.insert(piece_id);
    }
    from = to;
  }
}

/// What of a keyframe's line lies in stale squares, and a little more.
std::vector<DenseLine> Concatenator::stale_parts(const DenseLine& incoming) const {
  std::vector<DenseLine> parts;
  const std::size_t count = incoming.vertices.size();
  const auto is_stale = [&](std::size_t i) { return footprints_.is_stale(incoming.vertices[i].p); };
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_stale(i)) continue;
    const std::size_t first = i - std::min(i, kOverlapVertices);
    std::size_t last = i;
    for (std::size_t k = i; k < std::min(count, last + 2 * kOverlapVertices + 1); ++k) {
      if (is_stale(k)) last = k;
    }
    i = last;
    last = std::min(count - 1, last + kOverlapVertices);
    if (last == first) continue;
    DenseLine part = incoming;
    part.vertices.assign(incoming.vertices.begin() + static_cast<std::ptrdiff_t>(first),
                         incoming.vertices.begin() + static_cast<std::ptrdiff_t>(last + 1));
    const double share = static_cast<double>(last - first + 1) / static_cast<double>(count);
    for (double& votes_m : part.kind_votes_m) votes_m *= share;
    part.existence_sum *= share;
    part.existence_weight *= share;
    if (first > 0) part.first_end = EndKind::unseen;
    if (last + 1 < count) part.last_end = EndKind::unseen;
    parts.push_back(std::move(part));
  }
  return parts;
}

/// An id for a line that has no observation of its own to be named after. Ids once given are never given again.
LineId Concatenator::spare_id() {
  while (lines_.find(next_spare_id_) != nullptr || publisher_.map().contains(next_spare_id_)) ++next_spare_id_;
  return next_spare_id_++;
}

}  // namespace roadvec
