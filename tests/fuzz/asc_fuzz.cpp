#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/ensure.h"
#include "drivers/can/asc_line.h"

using namespace roadvec;

/// Any text, line after line, is frames within the bounds of their kind, events, or bad lines with a reason.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view text(reinterpret_cast<const char*>(data), size);
  AscLines asc;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(line.size() == text.size() ? line.size() : line.size() + 1);
    const CandumpLine result = asc.parse(line);
    ENSURE((result.kind == CandumpKind::bad) == !result.reason.empty());
    if (result.kind != CandumpKind::frame) continue;
    ENSURE(result.frame.length <= (result.frame.fd ? kMaxCanBytes : 8));
    ENSURE(result.frame.id <= (result.frame.extended ? 0x1FFFFFFFU : 0x7FFU));
    ENSURE(result.frame.time.ns >= 0);
  }
  return 0;
}
