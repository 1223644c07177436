#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/time.h"

namespace roadvec {

/// When the messages of one stream came: how often, how evenly, and how long it was silent.
class StreamStats {
 public:
  void add(SensorTime time);

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] SensorTime first() const { return first_; }
  [[nodiscard]] SensorTime last() const { return last_; }
  [[nodiscard]] double duration_s() const { return seconds_between(first_, last_); }
  [[nodiscard]] double rate_hz() const;        ///< 0: unknown
  [[nodiscard]] double median_step_s() const;  ///< of the first kMostSteps steps
  [[nodiscard]] double jitter_s() const;       ///< standard deviation of the steps, those over pauses left out
  [[nodiscard]] double longest_pause_s() const { return longest_pause_s_; }
  [[nodiscard]] std::uint64_t pause_count() const;  ///< steps of more than five times the median
  [[nodiscard]] std::uint64_t backward_count() const { return backward_count_; }

  [[nodiscard]] nlohmann::ordered_json json() const;
  [[nodiscard]] std::string text() const;  ///< "1808.0 per second, jitter 0.02 ms, 2 pauses, the longest 0.3 s"

 private:
  static constexpr std::size_t kMostSteps = 1 << 20;
  std::uint64_t count_ = 0, backward_count_ = 0;
  SensorTime first_, last_;
  std::vector<double> steps_s_;
  double longest_pause_s_ = 0;
};

}  // namespace roadvec
