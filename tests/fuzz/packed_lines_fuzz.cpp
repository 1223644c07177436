#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "core/map/packed_lines.h"

/// Any bytes are refused, or lines that have the same bytes again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  const std::span bytes(data, size);
  const std::optional<PackedLines> lines = PackedLines::from_bytes(bytes);
  if (!lines) return 0;
  LineSet unpacked;
  lines->append_to(unpacked);
  const std::vector<std::uint8_t> again = lines->bytes();
  if (again.size() != size) std::abort();
  const std::optional<PackedLines> twice = PackedLines::from_bytes(again);
  if (!twice || twice->bytes() != again) std::abort();
  return 0;
}
