#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/geometry/pose2.h"

namespace roadvec {

enum class BoundaryKind : std::uint8_t { unknown = 0, curb = 1, barrier = 2, vegetation = 3, vehicle_row = 4 };

/// Why a boundary ends here.
enum class EndKind : std::uint8_t {
  unseen = 0,    ///< range or field of view ends
  open = 1,      ///< free space follows: the mouth of a street or a drive
  occluded = 2,  ///< something nearer hides the rest
};

inline constexpr std::array<std::string_view, 5> kBoundaryKindNames{"unknown", "curb", "barrier", "vegetation",
                                                                    "vehicle_row"};
inline constexpr std::array<std::string_view, 3> kEndKindNames{"unseen", "open", "occluded"};
[[nodiscard]] constexpr std::string_view name_of(BoundaryKind kind) {
  return kBoundaryKindNames[static_cast<std::size_t>(kind)];
}
[[nodiscard]] constexpr std::string_view name_of(EndKind kind) { return kEndKindNames[static_cast<std::size_t>(kind)]; }

/// A vertex of a boundary line, with what was measured there.
struct Vertex {
  double x_m = 0, y_m = 0;
  float z_m = 0;       ///< of the road beside it, above the rear axle's ground plane (vehicle) or the anchor (map)
  float height_m = 0;  ///< of the boundary above the road
  float sigma_across_m = 0;  ///< standard deviation across the line
  float sigma_along_m = 0;

  [[nodiscard]] Eigen::Vector2d position() const { return {x_m, y_m}; }
  friend bool operator==(const Vertex&, const Vertex&) = default;
};

/// What is known of a whole boundary line.
struct LineAttributes {
  BoundaryKind kind = BoundaryKind::unknown;
  EndKind first_end = EndKind::unseen, last_end = EndKind::unseen;
  float height_m = 0;                   ///< median of the vertices
  float existence = 0;                  ///< probability that it is there, 0..1
  std::uint32_t observation_count = 0;  ///< sweeps that saw it
  friend bool operator==(const LineAttributes&, const LineAttributes&) = default;
};

/// Polylines in one pair of flat arrays: clear() keeps the memory, so a warm LineSet does not allocate.
/// A local vector map (LVM) of [He2018, III-B] is a LineSet in the vehicle frame.
class LineSet {
 public:
  struct Line {
    std::uint32_t first = 0, count = 0;  ///< range in vertices()
    LineAttributes attributes;
    friend bool operator==(const Line&, const Line&) = default;
  };

  void reserve(std::size_t vertex_count, std::size_t line_count) {
    vertices_.reserve(vertex_count);
    lines_.reserve(line_count);
  }
  void clear() {
    vertices_.clear();
    lines_.clear();
  }
  void begin_line(const LineAttributes& attributes) {
    lines_.push_back({static_cast<std::uint32_t>(vertices_.size()), 0, attributes});
  }
  void push_vertex(const Vertex& vertex) {
    vertices_.push_back(vertex);
    ++lines_.back().count;
  }
  void append(const LineSet& other) {
    for (const Line& line : other.lines_) {
      begin_line(line.attributes);
      for (const Vertex& vertex : other.vertices_of(line)) push_vertex(vertex);
    }
  }
  void drop_last_line() {
    vertices_.resize(lines_.back().first);
    lines_.pop_back();
  }

  [[nodiscard]] std::span<const Line> lines() const { return lines_; }
  [[nodiscard]] std::span<Line> lines() { return lines_; }
  [[nodiscard]] std::span<const Vertex> vertices() const { return vertices_; }
  [[nodiscard]] std::span<Vertex> vertices() { return vertices_; }
  [[nodiscard]] std::span<const Vertex> vertices_of(const Line& line) const {
    return std::span(vertices_).subspan(line.first, line.count);
  }
  [[nodiscard]] bool empty() const { return lines_.empty(); }
  friend bool operator==(const LineSet&, const LineSet&) = default;

 private:
  std::vector<Vertex> vertices_;
  std::vector<Line> lines_;
};

}  // namespace roadvec
