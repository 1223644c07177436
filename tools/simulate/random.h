#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

namespace roadvec {

/// Layers of equal area that cover the bell curve exp(-x^2 / 2): layer i is edge[i] wide and begins at height[i]; the
/// lowest stands for the tail too [MarsagliaTsang2000].
struct Ziggurat {
  static constexpr std::size_t kLayers = 256;
  static constexpr double kTail = 3.6541528853610088, kArea = 0.00492867323399;
  std::array<double, kLayers + 1> edge{}, height{};

  Ziggurat() {
    height[1] = std::exp(-kTail * kTail / 2);
    edge[0] = kArea / height[1];
    edge[1] = kTail;
    for (std::size_t i = 2; i < kLayers; ++i) {
      height[i] = height[i - 1] + kArea / edge[i - 1];
      edge[i] = std::sqrt(-2 * std::log(height[i]));
    }
    height[kLayers] = 1;
  }
};
inline const Ziggurat kZiggurat;

/// Seeded noise that is the same with every standard library, unlike std::normal_distribution. Each stream of one seed
/// is independent of the others, so that a change in one sensor leaves the rest of a drive as it was.
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : engine_(seed * 0x9E3779B97F4A7C15ULL + stream) {
    engine_.discard(16);
  }

  std::uint64_t bits() { return engine_(); }
  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  /// Mean 0, sigma 1.
  double normal() {
    while (true) {
      const std::uint64_t draw = engine_();
      const std::size_t layer = draw % Ziggurat::kLayers;
      const double x = static_cast<double>(static_cast<std::int64_t>(draw) >> 10) * 0x1p-53 * kZiggurat.edge[layer];
      if (std::abs(x) < kZiggurat.edge[layer + 1]) return x;
      if (layer == 0) return std::copysign(beyond_the_tail(), x);
      const double low = kZiggurat.height[layer], high = kZiggurat.height[layer + 1];
      if (low + uniform() * (high - low) < std::exp(-x * x / 2)) return x;
    }
  }

 private:
  double beyond_the_tail() {
    double over = 0, drop = 0;
    do {
      over = -std::log(1 - uniform()) / Ziggurat::kTail;
      drop = -std::log(1 - uniform());
    } while (2 * drop < over * over);
    return Ziggurat::kTail + over;
  }

  std::mt19937_64 engine_;
};

}  // namespace roadvec
