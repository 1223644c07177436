#include "tools/inspect/stream_stats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace roadvec {
namespace {

constexpr double kPauseInSteps = 5;

std::string duration_text(double s) {
  std::array<char, 32> text{};
  if (s < 1) {
    std::snprintf(text.data(), text.size(), "%.2f ms", s * 1e3);
  } else {
    std::snprintf(text.data(), text.size(), "%.2f s", s);
  }
  return text.data();
}

}  // namespace

void StreamStats::add(SensorTime time) {
  if (count_++ == 0) {
    first_ = last_ = time;
    return;
  }
  const double step_s = seconds_between(last_, time);
  if (step_s < 0) ++backward_count_;
  if (steps_s_.size() < kMostSteps) steps_s_.push_back(step_s);
  longest_pause_s_ = std::max(longest_pause_s_, step_s);
  last_ = std::max(last_, time);
}

double StreamStats::rate_hz() const { return duration_s() > 0 ? static_cast<double>(count_ - 1) / duration_s() : 0; }

double StreamStats::median_step_s() const {
  if (steps_s_.empty()) return 0;
  std::vector<double> steps = steps_s_;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::ranges::nth_element(steps, middle);
  return *middle;
}

double StreamStats::jitter_s() const {
  const double most_s = kPauseInSteps * std::max(median_step_s(), 1e-9);
  double sum = 0, square_sum = 0, count = 0;
  for (const double step : steps_s_) {
    if (step < 0 || step > most_s) continue;
    sum += step, square_sum += step * step, ++count;
  }
  return count < 2 ? 0 : std::sqrt(std::max(0.0, square_sum / count - (sum / count) * (sum / count)));
}

std::uint64_t StreamStats::pause_count() const {
  // Packets may come in bursts: their median step is nothing to measure pauses by.
  const double even_s = count_ > 1 ? duration_s() / static_cast<double>(count_ - 1) : 0;
  const double most_s = kPauseInSteps * std::max(median_step_s(), even_s);
  return static_cast<std::uint64_t>(std::ranges::count_if(steps_s_, [&](double step) { return step > most_s; }));
}

nlohmann::ordered_json StreamStats::json() const {
  return {{"count", count_},
          {"first_s", static_cast<double>(first_.ns) * 1e-9},
          {"duration_s", duration_s()},
          {"rate_hz", rate_hz()},
          {"median_step_s", median_step_s()},
          {"jitter_s", jitter_s()},
          {"pauses", pause_count()},
          {"longest_pause_s", longest_pause_s_},
          {"backward", backward_count_}};
}

std::string StreamStats::text() const {
  std::array<char, 64> rate{};
  std::snprintf(rate.data(), rate.size(), "%.1f per second", rate_hz());
  std::string text = rate.data();
  text += ", jitter " + duration_text(jitter_s());
  if (pause_count() > 0) {
    text += ", " + std::to_string(pause_count()) + " pauses, the longest " + duration_text(longest_pause_s_);
  }
  if (backward_count_ > 0) text += ", " + std::to_string(backward_count_) + " stamps go back";
  return text;
}

}  // namespace roadvec
