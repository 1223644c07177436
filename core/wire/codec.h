#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "core/wire/messages.h"

namespace roadvec::wire {

/// A frame is a u32 little-endian length and as many bytes of Envelope.
inline constexpr std::size_t kFrameHeaderBytes = 4;
inline constexpr std::size_t kMostServerBytes = std::size_t{16} << 20;  ///< longest Envelope from the server
inline constexpr std::size_t kMostClientBytes = std::size_t{1} << 20;   ///< longest Envelope to it

enum class Sender { client, server };

/// Writes one frame with the message (any alternative of Message but Unknown) into the buffer: the frame, or empty when
/// it does not fit. The same message gives the same bytes. Does not allocate or throw.
template <class M>
[[nodiscard]] std::string_view encode_frame(const M& message, std::span<char> buffer) noexcept;

/// Reads an Envelope (a frame without its length). Fields that are not known are skipped; values that cannot be (wrong
/// wire type, vertex counts that contradict each other, coordinates beyond kFarthest_mm, NaN) fail, and so does a
/// message that `from` does not send. Takes any bytes. Memory stays within a small multiple of the bytes given.
[[nodiscard]] Expected<Message> decode_envelope(std::string_view envelope, Sender from) noexcept;

/// Envelope length in a frame's header; `header` has kFrameHeaderBytes.
[[nodiscard]] std::uint32_t envelope_length(const char* header);

}  // namespace roadvec::wire
