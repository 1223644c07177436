#pragma once

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/wire/codec.h"

namespace roadvec::wire {

/// Cuts a byte stream into Envelopes: `received(read(fd, space()))`, then next() until it has none. The buffer grows
/// with the frame being received, up to the limit, and only once that many bytes have come: a length alone costs no
/// memory.
class FrameAssembler {
 public:
  explicit FrameAssembler(std::size_t most_envelope_bytes) : most_bytes_(most_envelope_bytes), buffer_(kStep) {}

  /// Where the next bytes go; not empty unless an Envelope waits. Ends the life of what next() gave.
  [[nodiscard]] std::span<char> space() {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    if (end_ == buffer_.size()) buffer_.resize(std::min(2 * buffer_.size(), most_bytes_ + kFrameHeaderBytes + kStep));
    return std::span(buffer_).subspan(end_);
  }
  void received(std::size_t count) { end_ += count; }

  /// A whole Envelope waits. Take it before asking for space(): then the buffer never fills up.
  [[nodiscard]] bool has_envelope() const {
    return end_ - begin_ >= kFrameHeaderBytes && !wrong_length() && end_ - begin_ - kFrameHeaderBytes >= length();
  }
  /// The next whole Envelope, valid until space(); none: more bytes are needed, or the length is wrong.
  [[nodiscard]] std::optional<std::string_view> next() {
    if (!has_envelope()) return std::nullopt;
    const std::string_view envelope(buffer_.data() + begin_ + kFrameHeaderBytes, length());
    begin_ += kFrameHeaderBytes + envelope.size();
    return envelope;
  }
  /// The stream is beyond repair: the next frame says 0 or more than the limit.
  [[nodiscard]] bool wrong_length() const {
    return end_ - begin_ >= kFrameHeaderBytes && (length() == 0 || length() > most_bytes_);
  }
  /// Bytes wait that are not a whole frame yet, or have not been taken.
  [[nodiscard]] bool has_bytes() const { return begin_ != end_; }

 private:
  [[nodiscard]] std::size_t length() const { return envelope_length(buffer_.data() + begin_); }

  static constexpr std::size_t kStep = 4096;
  std::size_t most_bytes_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;
};

}  // namespace roadvec::wire
