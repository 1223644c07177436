#include "drivers/can/signals.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace roadvec {

BitField BitField::of(const DbcSignal& signal) noexcept {
  const unsigned start = signal.start_bit;
  const unsigned length = signal.length_bits;
  BitField field;
  unsigned first_byte = 0;
  unsigned last_byte = 0;
  if (signal.order == ByteOrder::intel) {
    first_byte = start / 8;
    last_byte = (start + length - 1) / 8;
    field.least_byte = static_cast<std::uint8_t>(first_byte);
    field.shift = static_cast<std::uint8_t>(start % 8);
  } else {
    // Numbered as a Motorola signal runs: from bit 7 of a byte to its bit 0, then to bit 7 of the next byte.
    const unsigned first = start / 8 * 8 + (7 - start % 8);
    const unsigned last = first + length - 1;
    first_byte = first / 8;
    last_byte = last / 8;
    field.least_byte = static_cast<std::uint8_t>(last_byte);
    field.shift = static_cast<std::uint8_t>(7 - last % 8);
    field.step = -1;
  }
  field.last_byte = static_cast<std::uint8_t>(last_byte);
  field.byte_count = static_cast<std::uint8_t>(last_byte - first_byte + 1);
  field.mask = length == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << length) - 1;
  return field;
}

std::uint64_t BitField::extract(const CanFrame& frame) const noexcept {
  std::uint64_t bits = static_cast<std::uint64_t>(frame.data[least_byte]) >> shift;
  for (unsigned i = 1; i < byte_count; ++i) {
    // A field of 64 bits that does not begin on a byte touches nine: the ninth is shifted by 64 - shift at most.
    const int byte = least_byte + static_cast<int>(i) * step;
    bits |= static_cast<std::uint64_t>(frame.data[static_cast<std::size_t>(byte)]) << (8 * i - shift);
  }
  return bits & mask;
}

void BitField::clear(CanFrame& frame) const noexcept {
  for (unsigned i = 0; i < byte_count; ++i) {
    const std::uint64_t bits = i == 0 ? mask << shift : mask >> (8 * i - shift);
    const int byte = least_byte + static_cast<int>(i) * step;
    std::uint8_t& data = frame.data[static_cast<std::size_t>(byte)];
    data = static_cast<std::uint8_t>(data & ~bits);
  }
}

namespace {

/// What decides whether `signal` is in a frame; null: the file does not say.
const DbcSignal* selector_of(const DbcMessage& message, const DbcSignal& signal) {
  const DbcSignal* found = nullptr;
  bool nested = false;
  for (const DbcSignal& other : message.signals) {
    if (!signal.selector.empty() && other.name == signal.selector) return &other;
    if (other.is_selector && other.multiplex_values.empty()) found = &other;
    nested = nested || (other.is_selector && !other.multiplex_values.empty());
  }
  // A selector that is itself selected can only depend on the plain one; of a signal beside it nobody knows.
  return signal.selector.empty() && (!nested || signal.is_selector) ? found : nullptr;
}

}  // namespace

Expected<SignalDecoder> SignalDecoder::create(const DbcMessage& message, const DbcSignal& signal) {
  constexpr std::size_t kDeepest = 4;
  SignalDecoder decoder;
  decoder.bits_ = BitField::of(signal);
  decoder.coding_ = signal.coding;
  decoder.factor_ = signal.factor;
  decoder.offset_ = signal.offset;
  for (const DbcSignal* gated = &signal; !gated->multiplex_values.empty();) {
    const DbcSignal* selector = selector_of(message, *gated);
    if (selector == nullptr || decoder.gates_.size() == kDeepest) {
      return fail("signal " + message.name + "." + signal.name +
                  " is multiplexed, but the file does not say by which selector (M, or SG_MUL_VAL_)");
    }
    decoder.gates_.push_back({BitField::of(*selector), gated->multiplex_values});
    gated = selector;
  }
  return decoder;
}

bool SignalDecoder::Gate::open(const CanFrame& frame) const noexcept {
  const std::uint64_t value = selector.extract(frame);
  return std::any_of(values.begin(), values.end(),
                     [value](const DbcRange& range) { return value >= range.first && value <= range.last; });
}

bool SignalDecoder::fits(const CanFrame& frame) const noexcept {
  return bits_.fits(frame) &&
         std::all_of(gates_.begin(), gates_.end(), [&frame](const Gate& gate) { return gate.selector.fits(frame); });
}

std::optional<std::uint64_t> SignalDecoder::raw(const CanFrame& frame) const noexcept {
  if (!fits(frame)) return std::nullopt;
  if (!std::all_of(gates_.begin(), gates_.end(), [&frame](const Gate& gate) { return gate.open(frame); })) {
    return std::nullopt;
  }
  return bits_.extract(frame);
}

std::optional<double> SignalDecoder::physical(const CanFrame& frame) const noexcept {
  const std::optional<std::uint64_t> bits = raw(frame);
  if (!bits) return std::nullopt;
  double value = 0.0;
  switch (coding_) {
    case SignalCoding::unsigned_integer:
      value = static_cast<double>(*bits);
      break;
    case SignalCoding::signed_integer: {
      const std::uint64_t sign = bits_.mask ^ (bits_.mask >> 1);
      value = static_cast<double>(static_cast<std::int64_t>((*bits ^ sign) - sign));
      break;
    }
    case SignalCoding::float32:
      value = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(*bits)));
      break;
    case SignalCoding::float64:
      value = std::bit_cast<double>(*bits);
      break;
  }
  value = value * factor_ + offset_;
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace roadvec
