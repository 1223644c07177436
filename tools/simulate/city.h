#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"

namespace roadvec {

/// A scene file's text: a random town of streets at right angles and a drive through it, for whatever needs a long one.
/// Streets near the drive have houses, walls, hedges, fences, trees, driveways, parked cars and people; cars come the
/// other way. The same seed and length give the same text.
[[nodiscard]] Expected<std::string> city_scene(std::uint64_t seed, double length_km);

}  // namespace roadvec
