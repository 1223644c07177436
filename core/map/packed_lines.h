#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/geometry/line_set.h"
#include "core/geometry/pose2.h"

namespace roadvec {

/// A LineSet in a third of the memory: keyframes are kept for the whole drive. Positions to 2 mm, within 65 m of the
/// vehicle. Never changes; copies share it.
class PackedLines {
 public:
  PackedLines() = default;
  explicit PackedLines(const LineSet& lines);
  /// Adds the lines, moved by T_to_this, to `to`.
  void append_to(LineSet& to, const Pose2& T_to_this = {}) const;

  /// For a file: little-endian, a head of 20 bytes per line, then 10 bytes per vertex.
  [[nodiscard]] std::vector<std::uint8_t> bytes() const;
  /// None: these are not bytes() of any lines.
  [[nodiscard]] static std::optional<PackedLines> from_bytes(std::span<const std::uint8_t> bytes);

 private:
  struct PackedVertex {
    std::int16_t x_2mm, y_2mm, z_2mm, height_mm;
    std::uint8_t sigma_across_2mm, sigma_along_5mm;
  };
  struct Content {
    std::vector<PackedVertex> vertices;
    std::vector<LineSet::Line> lines;
  };
  std::shared_ptr<const Content> content_;
};

}  // namespace roadvec
