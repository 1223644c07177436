#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "core/map/dense_lines.h"
#include "core/map/footprints.h"
#include "core/map/publish.h"
#include "core/map/segment_index.h"
#include "core/map/vector_map.h"

namespace roadvec {

struct ConcatenateConfig {
  double vertex_spacing_m = 0.5;  ///< choice: a kerb radius of 3 m bends by 1 cm between two vertices
  double gate_m = 0.5;            ///< choice: 5 sigma of a kerb at 20 m, half the width of a 1 m island
  double angle_gate_deg = 40.0;   ///< choice: lines of one boundary, corners included
  bool directed = true;           ///< lines made by the virtual scan run clockwise: the free side is on their right
  double end_gate_m = 1.5;        ///< choice: ends of LVM lines wander by that much with the view
  double min_piece_m = 1.0;       ///< choice: shorter pieces are noise of a line's ends
  double min_sigma_m = 0.01;      ///< choice: bounds a vertex's weight, so that a map can still follow a changed road
  PublishConfig publish;
};
template <class Visitor>
void visit_fields(ConcatenateConfig& c, Visitor&& field) {
  field("concatenate.vertex_spacing_m", c.vertex_spacing_m, 0.1, 1.0,
        "distance of the vertices of a line inside the map");
  field("concatenate.gate_m", c.gate_m, 0.05, 1.0, "lines nearer than this are the same boundary");
  field("concatenate.angle_gate_deg", c.angle_gate_deg, 5.0, 90.0, "lines of one boundary differ by less in direction");
  field("concatenate.directed", c.directed, "lines of one boundary run the same way (free side on the right)");
  field("concatenate.end_gate_m", c.end_gate_m, 0.1, 10.0,
        "an observation leaving a line this near its end extends it");
  field("concatenate.min_piece_m", c.min_piece_m, 0.1, 20.0, "a shorter piece beside the known lines starts no line");
  field("concatenate.min_sigma_m", c.min_sigma_m, 0.001, 0.5, "smallest standard deviation that averaging can reach");
  visit_fields(c.publish, field);
}

/// Step 9, concatenate: merges the lines of keyframes into one ordered polyline per boundary [He2018, III-C-2].
///
/// Lines are kept dense, every vertex with its weight. A new line is sampled, each sample labelled with the map line it
/// lies on; runs of equal labels then update, extend, bridge, or start lines. Averaging moves vertices across the line
/// only, so their order never changes. Adding the same lines again changes counts, not geometry. Cost of add() does not
/// grow with the map. Ordinary thread; allocates. Ids derive from the keyframe and line that started a line, so that
/// they come out the same when the map is derived again; of two lines that become one the smaller id stays. Differs
/// from the paper: overlapping lines are averaged by their weights instead of being cut at their intersections, because
/// two noisy observations of one kerb cross every few metres and neither is right.
class Concatenator {
 public:
  explicit Concatenator(const ConcatenateConfig& config);

  void add(std::uint64_t keyframe, SensorTime time, const LineSet& lvm_vehicle, const Pose2& T_map_vehicle);

  /// Keyframes moved: withdraw() each of them from where it was added, forget() the geometry there (not what was
  /// published), add() them and the keyframes that forget() names in ascending order, and end_withdrawal(). A keyframe
  /// that moved is added as a new one; the others only where the geometry was forgotten. Costs what these keyframes
  /// cost.
  void withdraw(std::uint64_t keyframe, const LineSet& lvm_vehicle, const Pose2& T_map_vehicle);
  [[nodiscard]] std::set<std::uint64_t> forget();
  void end_withdrawal();

  /// Puts what changed since the last call into map() and `change`; `everything`: however little it changed.
  void publish(bool everything, MapChange& change);
  [[nodiscard]] const VectorMap& map() const { return publisher_.map(); }

 private:
  enum class End { first, last };
  struct Run {
    LineId line = 0;  ///< 0: on no line
    std::size_t first = 0, last = 0;
  };
  [[nodiscard]] DenseLine incoming_line(const LineSet& lvm, const LineSet::Line& line,
                                        const Pose2& T_map_vehicle) const;
  [[nodiscard]] std::vector<DenseLine> stale_parts(const DenseLine& incoming) const;
  void cut(LineId id);
  [[nodiscard]] LineId spare_id();
  void merge_in(const DenseLine& incoming, bool absorbing);
  void index_incoming(const DenseLine& incoming);
  void label(const DenseLine& incoming);
  void update(const DenseLine& incoming, bool absorbing);
  void update_vertices(DenseLine& line, std::int32_t from, std::int32_t to, bool absorbing);
  void add_evidence(DenseLine& line, const DenseLine& incoming, double share, bool absorbing) const;
  void settle_ends(const DenseLine& incoming);
  void connect(const DenseLine& incoming);
  void place_free_run(const DenseLine& incoming, const Run& run, LineId before, LineId after);
  [[nodiscard]] std::size_t count_along(const DenseLine& line, End end, const DenseLine& from, std::size_t first,
                                        std::size_t last) const;
  [[nodiscard]] bool goes_on(const DenseLine& line, End end, const DenseLine& from, std::size_t first,
                             std::size_t last) const;
  [[nodiscard]] bool meet(LineId first, LineId second) const;
  void extend(DenseLine& line, End end, const DenseLine& from, std::size_t first, std::size_t last);
  void start_line(const DenseLine& incoming, const Run& run);
  void join(LineId first, LineId second);
  [[nodiscard]] bool leaves_at(LineId id, End end, const DenseVertex& vertex) const;
  [[nodiscard]] LineId survivor_of(LineId id) const;
  void absorb_duplicates();
  [[nodiscard]] LineId duplicate_of(const DenseLine& line) const;
  void remember_successors(LineId prefix, const std::set<LineId>& touched);

  ConcatenateConfig config_;
  double min_cos_;
  DenseLines lines_;
  LinePublisher publisher_;
  std::map<LineId, LineId> absorbed_by_;           ///< of lines that became part of another
  std::map<LineId, std::set<LineId>> successors_;  ///< of published lines that did not come about again
  std::set<LineId> touched_;                       ///< since the last publish()
  Footprints footprints_;
  std::set<std::uint64_t> withdrawn_;  ///< until end_withdrawal()

  std::uint64_t keyframe_ = 0;  ///< the one being added
  bool again_ = false;          ///< it was added before, and did not move
  SensorTime time_;
  LineId next_spare_id_ = 0;
  std::set<LineId> touched_now_;
  LineSet incoming_lines_;
  SegmentIndex incoming_index_;
  std::vector<std::optional<DenseLines::Hit>> hits_;  ///< per incoming vertex: the segment it lies on
  std::vector<Run> runs_;
};

}  // namespace roadvec
