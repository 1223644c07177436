#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/ensure.h"
#include "drivers/can/candump_line.h"

using namespace roadvec;

/// Any line is a frame within the bounds of its kind, or says why it is none.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const CandumpLine line = parse_candump_line(std::string_view(reinterpret_cast<const char*>(data), size));
  ENSURE((line.kind == CandumpKind::bad) == !line.reason.empty());
  if (line.kind != CandumpKind::frame) return 0;
  ENSURE(line.frame.length <= (line.frame.fd ? kMaxCanBytes : 8));
  ENSURE(line.frame.id <= (line.frame.extended || line.frame.error ? 0x1FFFFFFFU : 0x7FFU));
  ENSURE(line.has_time || line.frame.time.ns == 0);
  ENSURE(line.frame.time.ns >= 0);
  return 0;
}
