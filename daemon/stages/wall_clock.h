#pragma once

#include <cstdint>

#include "core/base/time.h"

namespace roadvec {

/// Takes out of the kernel's stamps what the wall clock was set by since the start, because a car does not jump when
/// its clock does: each reading thread has one of these, and all see the same steps. What NTP does slowly stays in.
///
/// Pure: it is told what the clocks say. No allocation.
class WallClock {
 public:
  /// What the clocks say now: the wall clock between two readings of the steady one. Told often, so that little is
  /// stamped between a step and the next look.
  void look(std::int64_t before_ns, std::int64_t wall_ns, std::int64_t after_ns) noexcept;
  void look() noexcept;  ///< at the clocks of this machine

  /// `stamp`: of the wall clock, from before or after the last step, at or before the last look.
  [[nodiscard]] SensorTime without_steps(SensorTime stamp) const noexcept;
  /// How long ago the stamp was made.
  [[nodiscard]] std::int64_t age_ns(SensorTime stamp) const noexcept;

  [[nodiscard]] std::uint64_t step_count() const { return step_count_; }
  [[nodiscard]] std::int64_t last_step_ns() const { return last_step_ns_; }  ///< ahead: positive

 private:
  [[nodiscard]] bool is_from_before(SensorTime stamp) const noexcept;

  bool looked_ = false;
  std::int64_t wall_ns_ = 0;    ///< at the last look
  std::int64_t offset_ns_ = 0;  ///< wall minus steady at the last look
  std::int64_t steps_ns_ = 0, last_step_ns_ = 0;
  std::uint64_t step_count_ = 0;
};

}  // namespace roadvec
