#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/base/time.h"
#include "core/geometry/line_set.h"
#include "core/map/vector_map.h"

namespace roadvec {

/// A vertex of a map line before simplification, with the sufficient statistics of everything seen there.
struct DenseVertex {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();          ///< map frame
  Eigen::Vector2d published = Eigen::Vector2d::Zero();  ///< where the published line was made from
  double weight = 0;                                    ///< information across, 1 / m^2
  float z_m = 0, height_m = 0, sigma_along_m = 0;
  bool is_published = false;
  std::uint64_t last_keyframe = 0;  ///< that moved it: one keyframe counts once
};

/// A boundary of the map as it is kept: a vertex about every half metre, in order, free side on the right.
struct DenseLine {
  LineId id = 0;
  std::deque<DenseVertex> vertices;
  std::int32_t first_position = 0;  ///< of vertices.front(); positions of vertices never change while the line grows
  std::array<double, 5> kind_votes_m{};  ///< seen length per BoundaryKind
  EndKind first_end = EndKind::unseen, last_end = EndKind::unseen;
  double existence_sum = 0, existence_weight = 0;
  std::uint64_t observation_count = 0, keyframe_count = 0, last_keyframe = 0;
  SensorTime first_seen, last_seen;

  [[nodiscard]] std::int32_t end_position() const {
    return first_position + static_cast<std::int32_t>(vertices.size());
  }
  [[nodiscard]] DenseVertex& at(std::int32_t position) {
    return vertices[static_cast<std::size_t>(position - first_position)];
  }
  [[nodiscard]] const DenseVertex& at(std::int32_t position) const {
    return vertices[static_cast<std::size_t>(position - first_position)];
  }
  [[nodiscard]] Eigen::Vector2d direction_at(std::int32_t position) const;  ///< unit, along the neighbours
};

/// The dense lines of a map and a hash of where their vertices are.
///
/// Lookup touches only the cells around a point, so its cost does not grow with the map. The hash is never walked:
/// results depend on the lines alone, ties go to the smaller id and position.
class DenseLines {
 public:
  struct Gate {
    double distance_m = 0;
    double min_cos = 0;
    bool directed = true;
    LineId except = 0;  ///< a line that does not count; 0: none
  };
  struct Hit {
    LineId line = 0;
    std::int32_t position = 0;  ///< of the segment's first vertex
    double share = 0;           ///< of the segment before the foot
    double distance_m = 0;
  };

  /// `spacing_m`: greatest distance of two neighbouring vertices when they are appended.
  explicit DenseLines(double spacing_m);

  DenseLine& create(LineId id);
  void append(DenseLine& line, const DenseVertex& vertex);
  void prepend(DenseLine& line, const DenseVertex& vertex);
  void move(DenseLine& line, std::int32_t position, const Eigen::Vector2d& to);
  /// Removes a line and returns it.
  DenseLine take(LineId id);
  void clear();

  /// The nearest segment whose foot lies within its line: beyond an end there is no hit.
  [[nodiscard]] std::optional<Hit> nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& direction,
                                           const Gate& gate) const;
  [[nodiscard]] DenseLine* find(LineId id);
  [[nodiscard]] const std::map<LineId, DenseLine>& all() const { return lines_; }
  [[nodiscard]] std::map<LineId, DenseLine>& all() { return lines_; }

 private:
  struct Entry {
    LineId line;
    std::int32_t position;
    DenseLine* owner;   ///< std::map keeps its address
    Eigen::Vector2d p;  ///< of the vertex: most entries of a cell are told too far by it alone
  };
  void enter(DenseLine& line, std::int32_t position);
  void leave(const DenseLine& line, std::int32_t position);
  void consider(const Entry& entry, const Eigen::Vector2d& point, const Eigen::Vector2d& direction, const Gate& gate,
                std::optional<Hit>& best) const;

  double longest_segment_m_;
  std::map<LineId, DenseLine> lines_;
  std::unordered_map<std::uint64_t, std::vector<Entry>> cells_;
};

}  // namespace roadvec
