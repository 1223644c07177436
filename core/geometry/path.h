#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/base/time.h"
#include "core/geometry/pose2.h"

namespace roadvec {

/// Poses of the vehicle over one sweep, in the odom frame, in order of time. push() never grows beyond the reserved
/// capacity: when it is full the newest pose replaces the last one. A copy reserves nothing until it is pushed to.
class Path {
 public:
  struct Stop {
    SensorTime time;
    Pose2 T_odom_vehicle;
  };

  explicit Path(std::size_t capacity = 4096) : capacity_(capacity) { stops_.reserve(capacity); }
  void clear() { stops_.clear(); }
  void push(SensorTime time, const Pose2& T_odom_vehicle) {
    if (stops_.size() == capacity_) stops_.pop_back();
    stops_.push_back({time, T_odom_vehicle});
  }
  [[nodiscard]] bool empty() const { return stops_.empty(); }
  [[nodiscard]] const Stop& start() const { return stops_.front(); }
  [[nodiscard]] const Stop& end() const { return stops_.back(); }

  /// Linear between stops, extrapolated from the nearest two outside; identity when the path is empty.
  [[nodiscard]] Pose2 at(SensorTime time) const {
    if (stops_.empty()) return {};
    if (stops_.size() == 1) return stops_.front().T_odom_vehicle;
    auto after = std::lower_bound(stops_.begin() + 1, stops_.end() - 1, time,
                                  [](const Stop& stop, SensorTime t) { return stop.time < t; });
    const Stop& a = *(after - 1);
    const Stop& b = *after;
    const double span_s = seconds_between(a.time, b.time);
    const double u = span_s > 0 ? seconds_between(a.time, time) / span_s : 0.0;
    const Pose2 &p = a.T_odom_vehicle, &q = b.T_odom_vehicle;
    return {p.x_m + u * (q.x_m - p.x_m), p.y_m + u * (q.y_m - p.y_m),
            wrap_rad(p.theta_rad + u * wrap_rad(q.theta_rad - p.theta_rad))};
  }

 private:
  std::size_t capacity_;  ///< 1 or more
  std::vector<Stop> stops_;
};

}  // namespace roadvec
