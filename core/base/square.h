#pragma once

namespace roadvec {

[[nodiscard]] constexpr double square(double v) { return v * v; }

}  // namespace roadvec
