#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/base/ensure.h"
#include "tools/import/head_fit.h"
#include "tools/import/kitti_files.h"

using namespace roadvec;

/// Any bytes give values that a drive can have, or an error that says something. The first byte chooses the file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> bytes(data + 1, size - 1);
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] % 4) {
    case 0: {
      const auto time = parse_kitti_time(text);
      ENSURE(time ? time->ns >= 0 : !time.error().message.empty());
      break;
    }
    case 1: {
      const auto sample = parse_oxts(text);
      ENSURE(sample ? std::isfinite(sample->forward_mps) : !sample.error().message.empty());
      break;
    }
    case 2: {
      const auto rigid = parse_rigid(text);
      ENSURE(rigid ? (rigid->linear() * rigid->linear().transpose()).isIdentity(1e-9) : !rigid.error().message.empty());
      break;
    }
    default: {
      const auto points = parse_scan(bytes);
      ENSURE(points ? points->size() <= bytes.size() / 16 : !points.error().message.empty());
      if (!points) break;
      const auto lasers = split_lasers(*points);
      ENSURE(lasers || !lasers.error().message.empty());
    }
  }
  return 0;
}
