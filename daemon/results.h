#pragma once

#include <filesystem>

#include "core/base/error.h"
#include "core/geometry/anchor.h"
#include "core/pipeline/back_end.h"
#include "core/wire/messages.h"
#include "daemon/config/settings.h"

namespace roadvec {

/// What a finished drive leaves behind.
struct Results {
  const BackEnd& back_end;
  Anchor anchor;
  wire::Status status;
};

[[nodiscard]] Anchor anchor_of(const Settings& settings);

/// Makes `directory` if it is missing, and says why nothing could be written there: asked before an hour is mapped.
[[nodiscard]] Expected<void> make_writable(const std::filesystem::path& directory);

/// Writes into `directory` (made if missing): map.geojson (WGS 84, RFC 7946), map.svg, trajectory.tum (T_map_vehicle at
/// the keyframes: t x y z qx qy qz qw) and report.json (counters, times per step, map figures). Each file appears whole
/// or not at all.
[[nodiscard]] Expected<void> write_all(const Results& results, const std::filesystem::path& directory);

}  // namespace roadvec
