#include <algorithm>
#include <protozero/basic_pbf_writer.hpp>
#include <protozero/buffer_fixed.hpp>

#include "core/wire/codec.h"
#include "core/wire/fields.h"

namespace roadvec::wire {
namespace {

using Buffer = protozero::fixed_size_buffer_adaptor;
using Writer = protozero::basic_pbf_writer<Buffer>;

/// Walks over one quantity of the vertices and gives each one's difference to the one before, as protozero's loop wants
/// it. (A transformed iota view would do; clang 14 does not compile the standard library's.)
struct Differences {
  const TileVertex* vertices;
  std::int32_t TileVertex::*value;
  std::int32_t first_previous;
  std::size_t i;

  std::int32_t operator*() const { return vertices[i].*value - (i == 0 ? first_previous : vertices[i - 1].*value); }
  Differences operator++(int) {
    const Differences before = *this;
    ++i;
    return before;
  }
  bool operator==(const Differences& other) const { return i == other.i; }
};

/// Writes the fields it is walked over. As in any proto3 encoder, a value equal to the default takes no bytes.
class Encoder {
 public:
  Encoder(Writer& writer, Buffer& buffer) : writer_(writer), buffer_(buffer) {}

  void number(protozero::pbf_tag_type tag, std::uint64_t value) {
    if (value != 0) writer_.add_uint64(tag, value);
  }
  void zigzag(protozero::pbf_tag_type tag, std::int32_t value) {
    if (value != 0) writer_.add_sint32(tag, value);
  }
  void fixed(protozero::pbf_tag_type tag, std::uint64_t value) {
    if (value != 0) writer_.add_fixed64(tag, value);
  }
  void fixed(protozero::pbf_tag_type tag, std::int64_t value) {
    if (value != 0) writer_.add_sfixed64(tag, value);
  }
  void real(protozero::pbf_tag_type tag, double value) {
    if (value != 0) writer_.add_double(tag, value);
  }
  void flag(protozero::pbf_tag_type tag, bool value) {
    if (value) writer_.add_bool(tag, value);
  }
  void text(protozero::pbf_tag_type tag, const std::string& value) {
    if (!value.empty()) writer_.add_string(tag, value);
  }
  template <class E>
  void choice(protozero::pbf_tag_type tag, E value, E /*last*/) {
    number(tag, static_cast<std::uint64_t>(value));
  }
  void numbers(protozero::pbf_tag_type tag, const std::vector<std::uint64_t>& values) {
    writer_.add_packed_uint64(tag, values.begin(), values.end());
  }
  template <class F>
  void nested(protozero::pbf_tag_type tag, F&& write) {
    const std::size_t before = buffer_.size();
    {
      Writer inner(writer_, tag);
      Encoder encoder(inner, buffer_);
      write(encoder, inner);
    }
    // protozero takes an empty message back; an element of a repeated field or a oneof must stay.
    if (buffer_.size() == before) writer_.add_message(tag, "", 0);
  }
  template <class M>
  void message(protozero::pbf_tag_type tag, const M& m) {
    nested(tag, [&](Encoder& encoder, Writer&) { fields(encoder, m); });
  }
  template <class M>
  void optional(protozero::pbf_tag_type tag, const std::optional<M>& m) {
    if (m) message(tag, *m);
  }
  template <class M>
  void repeated(protozero::pbf_tag_type tag, const std::vector<M>& values) {
    for (const M& value : values) message(tag, value);
  }
  void pieces(protozero::pbf_tag_type tag, const std::vector<TilePiece>& pieces, TileKey key) {
    for (const TilePiece& p : pieces)
      nested(tag, [&](Encoder& encoder, Writer& writer) { encoder.piece(writer, p, key); });
  }

 private:
  void piece(Writer& writer, const TilePiece& p, TileKey key) {
    number(1, p.line), number(2, p.revision);
    number(3, static_cast<std::uint64_t>(p.attributes.kind)),
        number(4, static_cast<std::uint64_t>(p.attributes.first_end));
    number(5, static_cast<std::uint64_t>(p.attributes.last_end));
    number(6, static_cast<std::uint64_t>(std::max(mm_from_m(p.attributes.height_m), 0)));
    number(7, static_cast<std::uint64_t>(std::clamp(mm_from_m(p.attributes.existence), 0, 1000)));
    number(8, p.attributes.observation_count), fixed(9, p.first_seen.ns);
    number(10, static_cast<std::uint64_t>(p.last_seen.ns) - static_cast<std::uint64_t>(p.first_seen.ns));
    number(11, p.first_vertex), number(12, p.line_vertex_count);
    // Neither the corner of a tile that has pieces nor a vertex is farther than kFarthest_mm (and a tile) from the
    // anchor: 32 bits hold every difference.
    const auto corner_mm = [](std::int32_t index) { return index * kTileSize_mm; };
    write_differences(writer, 13, p.vertices, &TileVertex::x_mm, corner_mm(key.ix), true);
    write_differences(writer, 14, p.vertices, &TileVertex::y_mm, corner_mm(key.iy), true);
    write_differences(writer, 15, p.vertices, &TileVertex::z_mm, 0, false);
    write_differences(writer, 16, p.vertices, &TileVertex::height_mm, 0, false);
    write_differences(writer, 17, p.vertices, &TileVertex::sigma_across_mm, 0, false);
    write_differences(writer, 18, p.vertices, &TileVertex::sigma_along_mm, 0, false);
  }

  static void write_differences(Writer& writer, protozero::pbf_tag_type tag, const std::vector<TileVertex>& vertices,
                                std::int32_t TileVertex::*value, std::int32_t previous, bool whole) {
    std::size_t count = vertices.size();
    const auto before = [&](std::size_t i) { return i == 0 ? previous : vertices[i - 1].*value; };
    while (!whole && count > 0 && vertices[count - 1].*value == before(count - 1)) --count;
    if (count == 0) return;
    writer.add_packed_sint32(tag, Differences{vertices.data(), value, previous, 0},
                             Differences{vertices.data(), value, previous, count});
  }

  Writer& writer_;
  Buffer& buffer_;
};

template <class M, class... Kinds>
constexpr protozero::pbf_tag_type number_of(const std::variant<Kinds...>*) {
  protozero::pbf_tag_type number = 0, i = 0;
  ((number = std::is_same_v<M, Kinds> ? i : number, ++i), ...);
  return number;
}

}  // namespace

template <class M>
std::string_view encode_frame(const M& message, std::span<char> buffer) noexcept {
  if (buffer.size() < kFrameHeaderBytes) return {};
  Buffer body(buffer.data() + kFrameHeaderBytes, std::min(buffer.size() - kFrameHeaderBytes, kMostServerBytes));
  try {
    Writer writer(body);
    Encoder(writer, body).message(number_of<M>(static_cast<const Message*>(nullptr)), message);
  } catch (const std::length_error&) {
    return {};
  }
  const std::size_t length = body.size();
  for (std::size_t i = 0; i < kFrameHeaderBytes; ++i) buffer[i] = static_cast<char>((length >> (8 * i)) & 0xFF);
  return {buffer.data(), kFrameHeaderBytes + length};
}

std::uint32_t envelope_length(const char* header) {
  std::uint32_t length = 0;
  for (std::size_t i = 0; i < kFrameHeaderBytes; ++i) {
    length |= std::uint32_t{static_cast<unsigned char>(header[i])} << (8 * i);
  }
  return length;
}

template std::string_view encode_frame(const Hello&, std::span<char>) noexcept;
template std::string_view encode_frame(const Welcome&, std::span<char>) noexcept;
template std::string_view encode_frame(const GetTiles&, std::span<char>) noexcept;
template std::string_view encode_frame(const Tiles&, std::span<char>) noexcept;
template std::string_view encode_frame(const Subscribe&, std::span<char>) noexcept;
template std::string_view encode_frame(const SnapshotBegin&, std::span<char>) noexcept;
template std::string_view encode_frame(const Tile&, std::span<char>) noexcept;
template std::string_view encode_frame(const SnapshotEnd&, std::span<char>) noexcept;
template std::string_view encode_frame(const Resumed&, std::span<char>) noexcept;
template std::string_view encode_frame(const Delta&, std::span<char>) noexcept;
template std::string_view encode_frame(const EpochChange&, std::span<char>) noexcept;
template std::string_view encode_frame(const Overrun&, std::span<char>) noexcept;
template std::string_view encode_frame(const Pose&, std::span<char>) noexcept;
template std::string_view encode_frame(const Status&, std::span<char>) noexcept;
template std::string_view encode_frame(const GetStatus&, std::span<char>) noexcept;
template std::string_view encode_frame(const Heartbeat&, std::span<char>) noexcept;
template std::string_view encode_frame(const Bye&, std::span<char>) noexcept;
template std::string_view encode_frame(const Error&, std::span<char>) noexcept;
template std::string_view encode_frame(const Ping&, std::span<char>) noexcept;
template std::string_view encode_frame(const Pong&, std::span<char>) noexcept;
template std::string_view encode_frame(const GetMetrics&, std::span<char>) noexcept;
template std::string_view encode_frame(const Metrics&, std::span<char>) noexcept;
template std::string_view encode_frame(const Command&, std::span<char>) noexcept;
template std::string_view encode_frame(const CommandResult&, std::span<char>) noexcept;

}  // namespace roadvec::wire
