#pragma once

#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "daemon/sensors.h"

namespace roadvec {

/// A drive's sweeps and motion samples as `roadvecd --drive` hands them to the front end, without its threads: the same
/// drive gives the same keyframes.
class DriveReader final : private SweepSink {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<DriveReader>> open(const Settings& drive);

  /// The next sweep, or null: the recording is over, or reading failed. Valid until the next call.
  [[nodiscard]] const Sweep* next();
  /// From the sweep before up to the end of this one, in order of time.
  [[nodiscard]] std::span<const MotionSample> motion() const { return motion_; }
  [[nodiscard]] const FrontEndSetup& setup() const { return setup_; }
  /// Why reading ended before the recording did; empty: it did not.
  [[nodiscard]] std::string error() const { return std::string(lidar_.source->error()); }

 private:
  DriveReader() = default;
  Sweep* claim() noexcept override { return &filling_; }
  void publish() noexcept override;
  [[nodiscard]] MotionInput* earliest() const;
  void take_motion();

  LidarCounters counters_;  // outlives the source
  LidarInput lidar_;
  VehicleInput vehicle_;
  FrontEndSetup setup_;
  std::unique_ptr<SweepDecoder> decoder_;
  Sweep filling_, current_;
  std::deque<Sweep> ready_;
  std::vector<MotionSample> motion_;
  bool over_ = false, started_ = false;
};

}  // namespace roadvec
