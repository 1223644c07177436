#include "daemon/store/geometry.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

namespace roadvec {
namespace {

static_assert(std::endian::native == std::endian::little, "geometry is written as the processor holds it");

constexpr std::int32_t kWgs84 = 4326;
constexpr std::uint32_t kLineStringZ = 1002;
constexpr std::uint8_t kLittleEndian = 1;
constexpr std::uint8_t kXyEnvelope = 1 << 1;
constexpr std::size_t kHeaderBytes = 8, kPositionBytes = 24, kLineHeaderBytes = 9;
/// Bytes of the envelope by its type: none, xy, xyz, xym, xyzm.
constexpr std::array<std::size_t, 5> kEnvelopeBytes{0, 32, 48, 48, 64};

template <class T>
void put(std::vector<std::uint8_t>& bytes, const T& value) {
  const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
  bytes.insert(bytes.end(), first, first + sizeof value);
}

template <class T>
T get(std::span<const std::uint8_t> bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

}  // namespace

void GeoEnvelope::add(const GeoPosition& p) {
  min_longitude_deg = std::min(min_longitude_deg, p.longitude_deg);
  max_longitude_deg = std::max(max_longitude_deg, p.longitude_deg);
  min_latitude_deg = std::min(min_latitude_deg, p.latitude_deg);
  max_latitude_deg = std::max(max_latitude_deg, p.latitude_deg);
}

void GeoEnvelope::add(const GeoEnvelope& other) {
  min_longitude_deg = std::min(min_longitude_deg, other.min_longitude_deg);
  max_longitude_deg = std::max(max_longitude_deg, other.max_longitude_deg);
  min_latitude_deg = std::min(min_latitude_deg, other.min_latitude_deg);
  max_latitude_deg = std::max(max_latitude_deg, other.max_latitude_deg);
}

std::vector<std::uint8_t> geometry_blob(std::span<const GeoPosition> line, const GeoEnvelope& envelope) {
  std::vector<std::uint8_t> bytes{'G', 'P', 0, kXyEnvelope | kLittleEndian};
  bytes.reserve(kHeaderBytes + kEnvelopeBytes[1] + kLineHeaderBytes + line.size() * kPositionBytes);
  put(bytes, kWgs84);
  for (const double edge_deg :
       {envelope.min_longitude_deg, envelope.max_longitude_deg, envelope.min_latitude_deg, envelope.max_latitude_deg}) {
    put(bytes, edge_deg);
  }
  bytes.push_back(kLittleEndian);
  put(bytes, kLineStringZ);
  put(bytes, static_cast<std::uint32_t>(line.size()));
  for (const GeoPosition& p : line) {
    put(bytes, p.longitude_deg);
    put(bytes, p.latitude_deg);
    put(bytes, p.height_m);
  }
  return bytes;
}

std::optional<std::vector<GeoPosition>> positions_in(std::span<const std::uint8_t> blob) {
  if (blob.size() < kHeaderBytes || blob[0] != 'G' || blob[1] != 'P' || (blob[3] & kLittleEndian) == 0) return {};
  const std::size_t envelope_type = blob[3] >> 1 & 7;
  if (envelope_type >= kEnvelopeBytes.size()) return {};
  const std::size_t begin = kHeaderBytes + kEnvelopeBytes[envelope_type];
  if (blob.size() < begin + kLineHeaderBytes || blob[begin] != kLittleEndian) return {};
  if (get<std::uint32_t>(blob, begin + 1) != kLineStringZ) return {};
  const std::size_t count = get<std::uint32_t>(blob, begin + 5);
  if ((blob.size() - begin - kLineHeaderBytes) != count * kPositionBytes) return {};
  std::vector<GeoPosition> line;
  line.reserve(count);
  for (std::size_t at = begin + kLineHeaderBytes; at < blob.size(); at += kPositionBytes) {
    const GeoPosition p{get<double>(blob, at), get<double>(blob, at + 8), get<double>(blob, at + 16)};
    const bool on_earth = std::abs(p.longitude_deg) <= 180 && std::abs(p.latitude_deg) <= 90;
    if (!on_earth || !std::isfinite(p.height_m)) return {};
    line.push_back(p);
  }
  return line;
}

}  // namespace roadvec
