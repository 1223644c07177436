#include <cstdlib>

#include "daemon/store/geometry.h"

/// The binary of a line in a map file that others may have written: what is read is written and read again as it was.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  const auto line = positions_in({data, size});
  if (!line) return 0;
  GeoEnvelope envelope;
  for (const GeoPosition& position : *line) envelope.add(position);
  if (positions_in(geometry_blob(*line, envelope)) != line) std::abort();
  return 0;
}
