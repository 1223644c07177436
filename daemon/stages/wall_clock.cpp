#include "daemon/stages/wall_clock.h"

#include <chrono>

namespace roadvec {
namespace {

constexpr std::int64_t kLeastStep_ns = 50'000'000;  // the adjtime() of NTP is a thousand times slower at its fastest
constexpr std::int64_t kSureReading_ns = 1'000'000;
constexpr int kMostReadings = 3;

std::int64_t ns_of(auto time) { return std::chrono::nanoseconds(time.time_since_epoch()).count(); }

}  // namespace

void WallClock::look() noexcept {
  std::int64_t before_ns = 0, wall_ns = 0, after_ns = ns_of(std::chrono::steady_clock::now());
  for (int i = 0; i < kMostReadings; ++i) {
    before_ns = after_ns;
    wall_ns = ns_of(std::chrono::system_clock::now());
    after_ns = ns_of(std::chrono::steady_clock::now());
    if (after_ns - before_ns < kSureReading_ns) break;  // nobody interrupted us in between
  }
  look(before_ns, wall_ns, after_ns);
}

void WallClock::look(std::int64_t before_ns, std::int64_t wall_ns, std::int64_t after_ns) noexcept {
  // The offset lies between these two.
  const std::int64_t least_ns = wall_ns - after_ns - offset_ns_, most_ns = wall_ns - before_ns - offset_ns_;
  const bool stepped = looked_ && (least_ns > kLeastStep_ns || most_ns < -kLeastStep_ns);
  if (stepped) {
    last_step_ns_ = most_ns;
    steps_ns_ += last_step_ns_;
    ++step_count_;
  }
  // Interrupted, it would be off by as much.
  if (stepped || !looked_ || after_ns - before_ns < kSureReading_ns) offset_ns_ = wall_ns - before_ns;
  looked_ = true;
  wall_ns_ = wall_ns;
}

SensorTime WallClock::without_steps(SensorTime stamp) const noexcept {
  return stamp - (is_from_before(stamp) ? steps_ns_ - last_step_ns_ : steps_ns_);
}

std::int64_t WallClock::age_ns(SensorTime stamp) const noexcept {
  const std::int64_t age_ns = wall_ns_ - stamp.ns - (is_from_before(stamp) ? last_step_ns_ : 0);
  return age_ns > 0 ? age_ns : 0;
}

/// A stamp is read soon after it was made: of the two moments that it may stand for the later one that is not still to
/// come.
bool WallClock::is_from_before(SensorTime stamp) const noexcept {
  const std::int64_t age_ns = wall_ns_ - stamp.ns, age_if_before_ns = age_ns - last_step_ns_;
  const bool to_come = age_ns < -kSureReading_ns, before_to_come = age_if_before_ns < -kSureReading_ns;
  if (to_come != before_to_come) return to_come;
  return age_if_before_ns < age_ns;
}

}  // namespace roadvec
