#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "core/base/angle.h"

namespace roadvec {

/// Seeded noise that is the same with every standard library, unlike std::normal_distribution. Each stream of one seed
/// is independent of the others, so that a change in one sensor leaves the rest of a drive as it was.
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : engine_(seed * 0x9E3779B97F4A7C15ULL + stream) {
    engine_.discard(16);
  }

  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  /// Mean 0, sigma 1 [BoxMuller1958].
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(1 - uniform())), angle_rad = kTwoPi * uniform();
    spare_ = radius * std::sin(angle_rad);
    has_spare_ = true;
    return radius * std::cos(angle_rad);
  }

 private:
  std::mt19937_64 engine_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace roadvec
