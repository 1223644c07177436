#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/ensure.h"
#include "drivers/can/dbc.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/can/signals.h"

using namespace roadvec;

/// Any text loads; every signal that it yields decodes any frame within its bounds.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const DbcFile file = parse_dbc(text, "fuzz");
  CanFrame frame;
  for (std::size_t i = 0; i < kMaxCanBytes && i < size; ++i) frame.data[i] = data[size - 1 - i];
  for (const DbcMessage& message : file.messages) {
    for (const DbcSignal& signal : message.signals) {
      ENSURE(signal.length_bits >= 1 && signal.length_bits <= 64);
      const Expected<SignalDecoder> decoder = SignalDecoder::create(message, signal);
      if (!decoder) continue;
      for (const std::size_t length : {std::size_t{0}, std::size_t{message.length_bytes}, kMaxCanBytes}) {
        frame.length = static_cast<std::uint8_t>(length);
        const bool has_raw = decoder->raw(frame).has_value();
        ENSURE(!has_raw || decoder->fits(frame));
        ENSURE(!decoder->physical(frame) || has_raw);
      }
      const std::string name = message.name + "." + signal.name;
      VehicleSignals signals;
      signals.steering.sum = {name};
      signals.steering.unit = "deg";
      signals.steering.valid = name;
      signals.wheel_speeds.emplace_back().sum = {name};
      signals.wheel_speeds[0].unit = "km/h";
      signals.messages.push_back({message.name, signal.name, signal.name, ChecksumKind::hyundai_canfd, 0.0});
      Expected<MotionDecoder> motion = MotionDecoder::create(file, signals);
      if (!motion) continue;
      frame.id = motion->ids()[0].id;
      frame.extended = motion->ids()[0].extended;
      ENSURE(motion->decode(frame).size() <= 2);
    }
  }
  static_cast<void>(find_signal(file, text.substr(0, 40)));
  return 0;
}
