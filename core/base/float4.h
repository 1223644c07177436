#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

namespace roadvec {

// Four lanes side by side: the compilers' own vector type, SSE2 on x86-64 and NEON on arm64, whether the optimiser sees
// a loop that it can unroll or not.
using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));

template <class Vector, class Scalar>
[[nodiscard]] inline Vector load(const Scalar* from) noexcept {
  Vector vector;
  std::memcpy(&vector, from, sizeof vector);
  return vector;
}
template <class Vector, class Scalar>
inline void store(Vector vector, Scalar* to) noexcept {
  std::memcpy(to, &vector, sizeof vector);
}
/// x, y, z of four points that lie apart, side by side; the fourth value of each is left out.
struct Points4 {
  Float4 x, y, z;
};
[[nodiscard]] inline Points4 transpose(Float4 a, Float4 b, Float4 c, Float4 d) noexcept {
  const Float4 xy_ab = __builtin_shufflevector(a, b, 0, 4, 1, 5), xy_cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 z_ab = __builtin_shufflevector(a, b, 2, 6, 2, 6), z_cd = __builtin_shufflevector(c, d, 2, 6, 2, 6);
  return {__builtin_shufflevector(xy_ab, xy_cd, 0, 1, 4, 5), __builtin_shufflevector(xy_ab, xy_cd, 2, 3, 6, 7),
          __builtin_shufflevector(z_ab, z_cd, 0, 1, 4, 5)};
}
/// `value` where the comparison held, elsewhere 0.
[[nodiscard]] inline Float4 where(Int4 held, Float4 value) noexcept {
  return std::bit_cast<Float4>(held & std::bit_cast<Int4>(value));
}
[[nodiscard]] inline Float4 absolute(Float4 value) noexcept {
  return std::bit_cast<Float4>(std::bit_cast<Int4>(value) & 0x7FFFFFFF);
}

}  // namespace roadvec
