#pragma once

#include <optional>
#include <string_view>

#include "drivers/velodyne/calibration.h"

namespace roadvec {

// What the readers of calibration files share.

inline constexpr std::size_t kMostLasers = 128;

/// Without blanks at either end.
[[nodiscard]] std::string_view trimmed(std::string_view text);
/// A finite number and nothing else; blanks around it do not matter.
[[nodiscard]] std::optional<double> number_in(std::string_view text);
/// What is out of bounds that no real head comes near: they keep a wrong unit or a damaged digit from bending the whole
/// map. Null: nothing.
[[nodiscard]] const char* implausible(const LaserCalibration& laser) noexcept;

}  // namespace roadvec
