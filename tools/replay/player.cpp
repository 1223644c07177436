#include "tools/replay/player.h"

#include <time.h>

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kLongestSleep_ns = kSecond_ns / 10;  // a signal between a check and a sleep is seen after this
constexpr double kPauseBetweenLoops_s = 0.1;                // one revolution

std::int64_t clock_ns(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * kSecond_ns + now.tv_nsec;
}
std::int64_t monotonic_ns() { return clock_ns(CLOCK_MONOTONIC); }

/// The date of a moment on CLOCK_MONOTONIC; asked anew each time, because dates are stepped.
SensorTime wall_time(std::int64_t moment_ns) {
  constexpr int kTries = 5;  // a pause between the two clocks would show as an error of the date
  std::int64_t shift_ns = 0, least_ns = kSecond_ns * kSecond_ns;
  for (int i = 0; i < kTries && least_ns > 10'000; ++i) {
    const std::int64_t before_ns = monotonic_ns();
    const std::int64_t wall_ns = clock_ns(CLOCK_REALTIME);
    const std::int64_t apart_ns = monotonic_ns() - before_ns;
    if (apart_ns < least_ns) least_ns = apart_ns, shift_ns = wall_ns - before_ns;
  }
  return {moment_ns + shift_ns};
}

std::int64_t ns_from_s(double seconds) {
  return static_cast<std::int64_t>(std::llround(std::clamp(seconds, -1e9, 1e9) * 1e9));
}

}  // namespace

Player::Player(const PlayPlan& plan, const Tracks& tracks, const std::atomic<bool>& stop,
               std::function<void(const PlayReport&)> tell)
    : plan_(plan), tracks_(tracks), stop_(stop), tell_(std::move(tell)) {}

Expected<PlayReport> Player::run() {
  std::int64_t start_ns = monotonic_ns();
  begun_ns_ = told_ns_ = start_ns;
  do {
    if (const auto ready = rewind(); !ready) return tl::make_unexpected(ready.error());
    if (!play_once(start_ns)) {
      if (stop_.load()) break;
      return fail("the drive holds nothing to play between --from and --to; choose a longer stretch");
    }
    ++report_.loop_count;
    played_before_s_ = report_.played_s;
    start_ns =
        begun_ns_ +
        ns_from_s((report_.played_s + kPauseBetweenLoops_s * static_cast<double>(report_.loop_count)) / plan_.speed);
  } while (plan_.loop && !stop_.load());
  report_.taken_s = static_cast<double>(monotonic_ns() - begun_ns_) * 1e-9;
  report_.interrupted = stop_.load();
  return report_;
}

Expected<void> Player::rewind() {
  heads_.clear();
  std::optional<SensorTime> first;  // of all recordings, played or not: --from means the same whatever is played
  for (const auto& track : tracks_) {
    if (const auto ready = track->rewind(); !ready) return ready;
    const auto time = track->next();
    if (!time) continue;
    if (!first || *time < *first) first = time;
    if (track->has_output()) heads_.push_back({track.get(), *time});
  }
  begin_ = first.value_or(SensorTime{}) + ns_from_s(plan_.from_s);
  end_ = first.value_or(SensorTime{}) + ns_from_s(plan_.to_s);
  return {};
}

Player::Head* Player::earliest() {
  const auto head =
      std::min_element(heads_.begin(), heads_.end(), [](const Head& a, const Head& b) { return a.time < b.time; });
  return head == heads_.end() ? nullptr : &*head;
}

void Player::advance(Head& head) {
  if (const auto time = head.track->next()) {
    head.time = *time;
  } else {
    heads_.erase(heads_.begin() + (&head - heads_.data()));
  }
}

/// False: there was nothing to play, or `stop` came first.
bool Player::play_once(std::int64_t start_ns) {
  bool played = false;
  for (Head* head = earliest(); head && head->time <= end_ && !stop_.load(); advance(*head), head = earliest()) {
    if (head->time < begin_) continue;
    const double into_s = seconds_between(begin_, head->time);
    std::int64_t due_ns = start_ns + ns_from_s(into_s / plan_.speed);
    if (!plan_.as_fast_as_possible) sleep_until(due_ns);
    if (stop_.load()) break;
    const std::int64_t now_ns = monotonic_ns();
    if (plan_.as_fast_as_possible) due_ns = now_ns;
    head->track->send({.wall = wall_time(due_ns), .may_wait = plan_.as_fast_as_possible, .stop = &stop_});
    played = true;
    report_.worst_lateness_s = std::max(report_.worst_lateness_s, static_cast<double>(now_ns - due_ns) * 1e-9);
    report_.played_s = std::max(report_.played_s, played_before_s_ + into_s);
    note_progress(now_ns);
  }
  return played;
}

void Player::sleep_until(std::int64_t due_ns) const {
  for (std::int64_t now_ns = monotonic_ns(); now_ns < due_ns && !stop_.load(); now_ns = monotonic_ns()) {
    const std::int64_t wake_ns = std::min(due_ns, now_ns + kLongestSleep_ns);
    const timespec wake{.tv_sec = wake_ns / kSecond_ns, .tv_nsec = wake_ns % kSecond_ns};
    ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
  }
}

void Player::note_progress(std::int64_t now_ns) {
  if (now_ns - told_ns_ < kSecond_ns) return;
  told_ns_ = now_ns;
  report_.taken_s = static_cast<double>(now_ns - begun_ns_) * 1e-9;
  tell_(report_);
}

}  // namespace roadvec
