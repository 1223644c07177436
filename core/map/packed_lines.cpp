#include "core/map/packed_lines.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace roadvec {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as the processor holds them");
constexpr std::size_t kLineBytes = 20, kVertexBytes = 10;

template <class Number>
void put(std::vector<std::uint8_t>& to, Number value) {
  const auto bytes = std::bit_cast<std::array<std::uint8_t, sizeof value>>(value);
  to.insert(to.end(), bytes.begin(), bytes.end());
}

template <class Number>
Number get(std::span<const std::uint8_t> bytes, std::size_t offset) {
  Number value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// Nearest whole number of units; what does not fit is put at the limit.
template <class Integer>
Integer packed(double value_m, double unit_m) {
  constexpr auto low = static_cast<double>(std::numeric_limits<Integer>::min());
  constexpr auto high = static_cast<double>(std::numeric_limits<Integer>::max());
  return static_cast<Integer>(std::clamp(std::round(value_m / unit_m), low, high));
}

}  // namespace

PackedLines::PackedLines(const LineSet& lines) {
  auto content = std::make_shared<Content>();
  content->lines.assign(lines.lines().begin(), lines.lines().end());
  content->vertices.reserve(lines.vertices().size());
  for (const Vertex& v : lines.vertices()) {
    content->vertices.push_back({packed<std::int16_t>(v.x_m, 0.002), packed<std::int16_t>(v.y_m, 0.002),
                                 packed<std::int16_t>(v.z_m, 0.002), packed<std::int16_t>(v.height_m, 0.001),
                                 packed<std::uint8_t>(v.sigma_across_m, 0.002),
                                 packed<std::uint8_t>(v.sigma_along_m, 0.005)});
  }
  content_ = std::move(content);
}

void PackedLines::append_to(LineSet& to, const Pose2& T_to_this) const {
  if (!content_) return;
  for (const LineSet::Line& line : content_->lines) {
    to.begin_line(line.attributes);
    for (std::uint32_t i = line.first; i < line.first + line.count; ++i) {
      const PackedVertex& v = content_->vertices[i];
      const Eigen::Vector2d p = T_to_this * Eigen::Vector2d(v.x_2mm * 0.002, v.y_2mm * 0.002);
      to.push_vertex({p.x(), p.y(), static_cast<float>(v.z_2mm * 0.002), static_cast<float>(v.height_mm * 0.001),
                      static_cast<float>(v.sigma_across_2mm * 0.002), static_cast<float>(v.sigma_along_5mm * 0.005)});
    }
  }
}

std::vector<std::uint8_t> PackedLines::bytes() const {
  std::vector<std::uint8_t> to;
  if (!content_) return to;
  for (const LineSet::Line& line : content_->lines) {
    const LineAttributes& a = line.attributes;
    put(to, line.count);
    for (const std::uint8_t byte : {static_cast<std::uint8_t>(a.kind), static_cast<std::uint8_t>(a.first_end),
                                    static_cast<std::uint8_t>(a.last_end), std::uint8_t{0}}) {
      to.push_back(byte);
    }
    put(to, a.height_m);
    put(to, a.existence);
    put(to, a.observation_count);
    for (std::uint32_t i = line.first; i < line.first + line.count; ++i) {
      const PackedVertex& v = content_->vertices[i];
      for (const std::int16_t value : {v.x_2mm, v.y_2mm, v.z_2mm, v.height_mm}) put(to, value);
      to.push_back(v.sigma_across_2mm);
      to.push_back(v.sigma_along_5mm);
    }
  }
  return to;
}

std::optional<PackedLines> PackedLines::from_bytes(std::span<const std::uint8_t> bytes) {
  auto content = std::make_shared<Content>();
  while (!bytes.empty()) {
    if (bytes.size() < kLineBytes) return std::nullopt;
    LineSet::Line line;
    line.first = static_cast<std::uint32_t>(content->vertices.size());
    line.count = get<std::uint32_t>(bytes, 0);
    LineAttributes& a = line.attributes;
    if (bytes[4] >= kBoundaryKindNames.size() || bytes[5] >= kEndKindNames.size() || bytes[6] >= kEndKindNames.size()) {
      return std::nullopt;
    }
    a.kind = BoundaryKind{bytes[4]};
    a.first_end = EndKind{bytes[5]};
    a.last_end = EndKind{bytes[6]};
    a.height_m = get<float>(bytes, 8);
    a.existence = get<float>(bytes, 12);
    a.observation_count = get<std::uint32_t>(bytes, 16);
    bytes = bytes.subspan(kLineBytes);
    if (!std::isfinite(a.height_m) || !std::isfinite(a.existence)) return std::nullopt;
    if (bytes.size() / kVertexBytes < line.count) return std::nullopt;
    for (std::uint32_t i = 0; i < line.count; ++i, bytes = bytes.subspan(kVertexBytes)) {
      content->vertices.push_back({get<std::int16_t>(bytes, 0), get<std::int16_t>(bytes, 2),
                                   get<std::int16_t>(bytes, 4), get<std::int16_t>(bytes, 6), bytes[8], bytes[9]});
    }
    content->lines.push_back(line);
  }
  PackedLines packed;
  packed.content_ = std::move(content);
  return packed;
}

}  // namespace roadvec
