#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame.h"

namespace roadvec {

/// A run of bits in a frame, in either byte order, unpacked with one loop over its bytes: from the byte with the least
/// significant bit towards the one with the most significant.
struct BitField {
  std::uint8_t least_byte = 0;
  std::int8_t step = 1;  ///< +1 Intel, -1 Motorola
  std::uint8_t byte_count = 0;
  std::uint8_t shift = 0;      ///< bits of least_byte below the field
  std::uint8_t last_byte = 0;  ///< the highest byte the field touches
  std::uint64_t mask = 0;

  [[nodiscard]] static BitField of(const DbcSignal& signal) noexcept;
  [[nodiscard]] bool fits(const CanFrame& frame) const noexcept { return last_byte < frame.length; }
  [[nodiscard]] std::uint64_t extract(const CanFrame& frame) const noexcept;  ///< only if it fits
  void clear(CanFrame& frame) const noexcept;                                 ///< its bits to 0; only if it fits
};

/// Takes one signal out of the frames of its message. No allocation, no exceptions once made.
class SignalDecoder {
 public:
  SignalDecoder() = default;
  /// Fails where the file does not say which selector a multiplexed signal depends on.
  [[nodiscard]] static Expected<SignalDecoder> create(const DbcMessage& message, const DbcSignal& signal);

  /// The frame is long enough for the signal (and for the selectors that say whether it is there).
  [[nodiscard]] bool fits(const CanFrame& frame) const noexcept;
  /// The bits as they are, without sign; nothing if the frame is too short or carries another multiplexed group.
  [[nodiscard]] std::optional<std::uint64_t> raw(const CanFrame& frame) const noexcept;
  /// raw * factor + offset; also nothing if a float signal is not a finite number.
  [[nodiscard]] std::optional<double> physical(const CanFrame& frame) const noexcept;
  [[nodiscard]] const BitField& bits() const noexcept { return bits_; }

 private:
  /// A selector, and the raw values of it at which the signal is in the frame.
  struct Gate {
    BitField selector;
    std::vector<DbcRange> values;
    [[nodiscard]] bool open(const CanFrame& frame) const noexcept;
  };
  BitField bits_;
  std::vector<Gate> gates_;  ///< all must be open: none for most signals, two where selectors are themselves selected
  SignalCoding coding_ = SignalCoding::unsigned_integer;
  double factor_ = 1.0;
  double offset_ = 0.0;
};

}  // namespace roadvec
