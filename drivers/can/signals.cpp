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

Expected<SignalDecoder> SignalDecoder::create(const DbcMessage& message, const DbcSignal& signal) {
  SignalDecoder decoder;
  decoder.bits_ = BitField::of(signal);
  decoder.coding_ = signal.coding;
  decoder.factor_ = signal.factor;
  decoder.offset_ = signal.offset;
  if (!signal.multiplex_value) return decoder;
  const auto is_plain_selector = [](const DbcSignal& s) { return s.is_selector && !s.multiplex_value; };
  const auto is_nested_selector = [](const DbcSignal& s) { return s.is_selector && s.multiplex_value; };
  const auto selector = std::find_if(message.signals.begin(), message.signals.end(), is_plain_selector);
  if (selector == message.signals.end()) {
    return fail("signal " + message.name + "." + signal.name + " is multiplexed, but its message has no selector");
  }
  if (std::any_of(message.signals.begin(), message.signals.end(), is_nested_selector)) {
    return fail("signal " + message.name + "." + signal.name + " uses extended multiplexing, which is not supported");
  }
  decoder.multiplexed_ = true;
  decoder.selector_ = BitField::of(*selector);
  decoder.selector_value_ = *signal.multiplex_value;
  return decoder;
}

std::optional<std::uint64_t> SignalDecoder::raw(const CanFrame& frame) const noexcept {
  if (!fits(frame)) return std::nullopt;
  if (multiplexed_ && selector_.extract(frame) != selector_value_) return std::nullopt;
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
