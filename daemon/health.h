#pragma once

#include <optional>
#include <string>

#include "core/odometry/odometry.h"
#include "drivers/can/can_reader.h"

namespace roadvec {

/// How a part of the daemon is: one word of the table in README.md, and a sentence that says what is wrong and helps.
struct Health {
  std::string state = "ok";
  std::string detail;
  [[nodiscard]] bool ok() const { return state == "ok"; }
};

// Pure: what was counted in, words out. Ages are seconds since the newest datum, none: it never came; rates are those
// of the last three seconds.

struct LidarFacts {
  bool awaits_calibration = false, ambiguous = false;
  std::optional<double> age_s{};
  double good_hz = 0, missing_hz = 0, disordered_hz = 0, noise_hz = 0;  ///< packets
  double revolutions_hz = 0;
  std::uint64_t revolution_count = 0, noise_count = 0;  ///< since the start
  std::string senders;                                  ///< of data packets; empty: none or not known
};
[[nodiscard]] Health health_of(const LidarFacts& facts);

struct CanFacts {
  CanState state = CanState::working;
  std::optional<double> age_s{};
  double frames_hz = 0, lost_hz = 0;  ///< without error frames
};
[[nodiscard]] Health health_of(const CanFacts& facts);

struct ImuFacts {
  bool device_is_lost = false;
  std::optional<double> age_s{};
  double bytes_hz = 0, samples_hz = 0, bad_hz = 0;
};
[[nodiscard]] Health health_of(const ImuFacts& facts);

struct MappingFacts {
  std::optional<double> age_s{};  ///< of the newest sweep that was mapped
  double refused_hz = 0;          ///< sweeps
  MotionSource speed = MotionSource::none, yaw = MotionSource::none;
  bool matched = false;
};
[[nodiscard]] Health health_of(const MappingFacts& facts);

/// A thread that has not turned for two seconds: whatever else it says is old.
[[nodiscard]] Health stuck();

}  // namespace roadvec
