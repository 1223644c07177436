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
/// `value` where the comparison held, elsewhere 0.
[[nodiscard]] inline Float4 where(Int4 held, Float4 value) noexcept {
  return std::bit_cast<Float4>(held & std::bit_cast<Int4>(value));
}
[[nodiscard]] inline Float4 absolute(Float4 value) noexcept {
  return std::bit_cast<Float4>(std::bit_cast<Int4>(value) & 0x7FFFFFFF);
}

}  // namespace roadvec
