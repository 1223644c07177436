#include <cmath>
#include <exception>
#include <limits>
#include <protozero/pbf_reader.hpp>
#include <stdexcept>

#include "core/wire/codec.h"
#include "core/wire/fields.h"

namespace roadvec::wire {
namespace {

using Type = protozero::pbf_wire_type;

/// Inside this file only: decode_envelope() turns it, and protozero's own exceptions, into an Error.
struct Malformed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Decoder;
template <class M>
void decode_into(M& m, protozero::pbf_reader reader);

/// Reads the current field of `reader` into the member that the walk names with its number.
class Decoder {
 public:
  explicit Decoder(protozero::pbf_reader& reader) : reader_(reader) {}
  [[nodiscard]] bool taken() const { return taken_; }

  void number(protozero::pbf_tag_type tag, std::uint64_t& value) {
    if (take(tag, Type::varint)) value = reader_.get_uint64();
  }
  void number(protozero::pbf_tag_type tag, std::uint32_t& value) {
    if (take(tag, Type::varint)) value = reader_.get_uint32();
  }
  void zigzag(protozero::pbf_tag_type tag, std::int32_t& value) {
    if (take(tag, Type::varint)) value = reader_.get_sint32();
  }
  void fixed(protozero::pbf_tag_type tag, std::uint64_t& value) {
    if (take(tag, Type::fixed64)) value = reader_.get_fixed64();
  }
  void fixed(protozero::pbf_tag_type tag, std::int64_t& value) {
    if (take(tag, Type::fixed64)) value = reader_.get_sfixed64();
  }
  void real(protozero::pbf_tag_type tag, double& value) {
    if (!take(tag, Type::fixed64)) return;
    value = reader_.get_double();
    if (!std::isfinite(value)) throw Malformed("a number that is not finite");
  }
  void flag(protozero::pbf_tag_type tag, bool& value) {
    // Not get_bool(): it looks at a byte before it checks that there is one (protozero 1.7.1, found by fuzzing).
    if (take(tag, Type::varint)) value = reader_.get_uint64() != 0;
  }
  void text(protozero::pbf_tag_type tag, std::string& value) {
    if (take(tag, Type::length_delimited)) value = reader_.get_string();
  }
  /// A choice of a later minor reads as the first one, which stands for "unknown" or "unspecified".
  template <class E>
  void choice(protozero::pbf_tag_type tag, E& value, E last) {
    if (!take(tag, Type::varint)) return;
    const std::uint64_t read = reader_.get_uint64();
    value = read <= static_cast<std::uint64_t>(last) ? static_cast<E>(read) : E{};
  }
  void numbers(protozero::pbf_tag_type tag, std::vector<std::uint64_t>& values) {
    if (!take(tag, Type::length_delimited)) return;
    for (const std::uint64_t value : reader_.get_packed_uint64()) values.push_back(value);
  }
  template <class M>
  void message(protozero::pbf_tag_type tag, M& m) {
    if (take(tag, Type::length_delimited)) decode_into(m, reader_.get_message());
  }
  template <class M>
  void optional(protozero::pbf_tag_type tag, std::optional<M>& m) {
    if (take(tag, Type::length_delimited)) decode_into(m.emplace(), reader_.get_message());
  }
  template <class M>
  void repeated(protozero::pbf_tag_type tag, std::vector<M>& values) {
    if (take(tag, Type::length_delimited)) decode_into(values.emplace_back(), reader_.get_message());
  }
  /// Relative to the tile's corner for now: the tile's key may come later. finish() moves them.
  void pieces(protozero::pbf_tag_type tag, std::vector<TilePiece>& pieces, const TileKey&) {
    if (take(tag, Type::length_delimited)) decode_into(pieces.emplace_back(), reader_.get_message());
  }
  void differences(protozero::pbf_tag_type tag, std::vector<TileVertex>& vertices, std::int32_t TileVertex::*value) {
    if (!take(tag, Type::length_delimited)) return;
    const bool defines_count = tag == 13, is_relative = tag == 13 || tag == 14;
    const std::int64_t farthest_mm = std::int64_t{kFarthest_mm} * (is_relative ? 2 : 1);
    std::int64_t sum_mm = 0;
    std::size_t count = 0;
    for (const std::int32_t difference_mm : reader_.get_packed_sint32()) {
      sum_mm += difference_mm;
      if (std::abs(sum_mm) > farthest_mm) throw Malformed("a vertex too far away");
      if (count == vertices.size()) {
        if (!defines_count) throw Malformed("more values than vertices");
        vertices.emplace_back();
      }
      vertices[count++].*value = static_cast<std::int32_t>(sum_mm);
    }
    if (tag == 14 && count != vertices.size()) throw Malformed("fewer y than x");
    for (std::size_t i = count; i < vertices.size(); ++i) vertices[i].*value = static_cast<std::int32_t>(sum_mm);
  }

 private:
  bool take(protozero::pbf_tag_type tag, Type type) {
    if (reader_.tag() != tag) return false;
    if (reader_.wire_type() != type) throw Malformed("a field of another type");
    taken_ = true;
    return true;
  }

  protozero::pbf_reader& reader_;
  bool taken_ = false;
};

using wire::fields;
template <Is<TilePiece> M>
void fields(Decoder& f, M& m) {
  std::uint64_t seen_for_ns = static_cast<std::uint64_t>(m.last_seen.ns);
  std::uint32_t height_mm = 0, existence_permille = 0;
  f.number(1, m.line), f.number(2, m.revision), f.choice(3, m.attributes.kind, BoundaryKind::vehicle_row);
  f.choice(4, m.attributes.first_end, EndKind::occluded), f.choice(5, m.attributes.last_end, EndKind::occluded);
  f.number(6, height_mm), f.number(7, existence_permille);
  f.number(8, m.attributes.observation_count), f.fixed(9, m.first_seen.ns), f.number(10, seen_for_ns);
  f.number(11, m.first_vertex), f.number(12, m.line_vertex_count);
  f.differences(13, m.vertices, &TileVertex::x_mm), f.differences(14, m.vertices, &TileVertex::y_mm);
  f.differences(15, m.vertices, &TileVertex::z_mm), f.differences(16, m.vertices, &TileVertex::height_mm);
  f.differences(17, m.vertices, &TileVertex::sigma_across_mm),
      f.differences(18, m.vertices, &TileVertex::sigma_along_mm);
  if (height_mm > kFarthest_mm || existence_permille > 1000) throw Malformed("a height or existence that cannot be");
  if (height_mm != 0) m.attributes.height_m = static_cast<float>(m_from_mm(static_cast<std::int32_t>(height_mm)));
  if (existence_permille != 0) m.attributes.existence = static_cast<float>(existence_permille / 1000.0);
  m.last_seen.ns = static_cast<std::int64_t>(seen_for_ns);  // a duration until finish()
}

void finish(auto&) {}

void finish(TilePiece& piece) {
  piece.last_seen.ns = static_cast<std::int64_t>(static_cast<std::uint64_t>(piece.last_seen.ns) +
                                                 static_cast<std::uint64_t>(piece.first_seen.ns));
  const std::uint64_t end = std::uint64_t{piece.first_vertex} + piece.vertices.size();
  if (piece.vertices.empty() || end > piece.line_vertex_count) throw Malformed("a piece that does not fit its line");
}

void place(std::vector<TilePiece>& pieces, TileKey key) {
  constexpr std::int32_t kFarthestTile = kFarthest_mm / kTileSize_mm + 1;
  const bool too_far = std::abs(std::int64_t{key.ix}) > kFarthestTile || std::abs(std::int64_t{key.iy}) > kFarthestTile;
  if (too_far && !pieces.empty()) throw Malformed("a tile too far away");
  const auto place_one = [](std::int32_t& value_mm, std::int32_t index) {
    const std::int64_t placed_mm = value_mm + std::int64_t{index} * kTileSize_mm;
    if (std::abs(placed_mm) > kFarthest_mm) throw Malformed("a vertex too far away");
    value_mm = static_cast<std::int32_t>(placed_mm);
  };
  for (TilePiece& piece : pieces) {
    for (TileVertex& vertex : piece.vertices) {
      place_one(vertex.x_mm, key.ix);
      place_one(vertex.y_mm, key.iy);
    }
  }
}
void finish(Tile& tile) { place(tile.pieces, tile.key); }
void finish(TileDelta& delta) { place(delta.upserted, delta.key); }

void finish(PoseCovariance& m) {
  m(1, 0) = m(0, 1);
  m(2, 0) = m(0, 2);
  m(2, 1) = m(1, 2);
}

/// On the wire an absent field is 0, whatever the value's own default is for those who make one.
void begin(auto&) {}
void begin(Hello& hello) { hello.proto_major = hello.proto_minor = 0; }
void begin(Welcome& welcome) { welcome.proto_major = welcome.proto_minor = welcome.tile_size_mm = 0; }

template <class M>
void decode_into(M& m, protozero::pbf_reader reader) {
  while (reader.next()) {
    Decoder decoder(reader);
    fields(decoder, m);
    if (!decoder.taken()) reader.skip();
  }
  finish(m);
}

template <class M>
constexpr bool sent_by_client = Is<M, Hello, GetTiles, Subscribe, GetStatus, Ping, GetMetrics, Command>;

template <std::size_t... kNumber>
Message decode_number(protozero::pbf_reader& reader, Sender from, std::index_sequence<kNumber...>) {
  Message message;
  const auto decode_as = [&]<std::size_t kIndex>() {
    using M = std::variant_alternative_t<kIndex, Message>;
    if constexpr (kIndex != 0) {
      if (sent_by_client<M> != (from == Sender::client)) throw Malformed("a message that only the other side sends");
      if (reader.wire_type() != Type::length_delimited) throw Malformed("a field of another type");
      M& m = message.emplace<kIndex>();
      begin(m);
      decode_into(m, reader.get_message());
    }
  };
  (void)((reader.tag() == kNumber && (decode_as.template operator()<kNumber>(), true)) || ...);
  return message;
}

}  // namespace

Expected<Message> decode_envelope(std::string_view envelope, Sender from) noexcept {
  try {
    protozero::pbf_reader reader(envelope.data(), envelope.size());
    Message message;
    while (reader.next()) {
      if (reader.tag() == 0 || reader.tag() >= std::variant_size_v<Message>) {
        reader.skip();
      } else {
        message = decode_number(reader, from, std::make_index_sequence<std::variant_size_v<Message>>{});
      }
    }
    return message;
  } catch (const std::exception& e) {
    return fail(e.what());
  }
}

}  // namespace roadvec::wire
