#pragma once

#include <string>

#include "core/base/error.h"
#include "tools/simulate/scene.h"

namespace roadvec {

/// The scene from above as SVG, a metre wide as ten units: roads, kerbs, what stands along them, what moves (where it
/// is in the middle of the drive), the car's way. What the scene's change takes away is dashed.
[[nodiscard]] Expected<std::string> picture_of(const Scene& scene);

}  // namespace roadvec
