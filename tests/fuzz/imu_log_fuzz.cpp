#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/ensure.h"
#include "drivers/imu/log_reader.h"

using namespace roadvec;

/// Any line gives bytes within their bound, or nothing.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view line(reinterpret_cast<const char*>(data), size);
  std::array<std::uint8_t, 64> bytes{};
  const auto parsed = parse_imu_log_line(line, bytes);
  if (!parsed) return 0;
  ENSURE(parsed->byte_count > 0 && parsed->byte_count <= bytes.size());
  ENSURE(parsed->time.ns >= 0);
  return 0;
}
