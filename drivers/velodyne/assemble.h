#pragma once

#include <cstdint>

#include "core/base/angle.h"
#include "core/sensor/lidar.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/decode.h"
#include "drivers/velodyne/packet_clock.h"

namespace roadvec {

/// Where sweeps go: a ring, or one slot in a test.
class SweepSink {
 public:
  virtual ~SweepSink() = default;
  /// A slot to fill, its `returns` reserved (max_returns_per_sweep()); null: all are taken. Claimed again without
  /// publish(): the same slot, because a sweep was withdrawn.
  virtual Sweep* claim() noexcept = 0;
  virtual void publish() noexcept = 0;
};

struct AssembleOptions {
  /// Where one revolution ends and the next begins: the head's own azimuth, clockwise from straight ahead. Behind the
  /// car by default, so that the seam in time does not cut the road ahead.
  double cut_azimuth_rad = kPi;
};

/// Returns -> sweeps: one revolution each, cut at one azimuth, between two readings of it and not between packets.
///
/// A sweep is `complete` if the assembler saw it from cut to cut with nothing missing. The head only turns forward: a
/// small step back is jitter and cuts nothing, a large one is packets lost and goes the long way round. A pause of
/// the sensor, or a jump of the clock, ends a sweep early. A head that stands still makes no sweeps. Times never go
/// back inside a sweep nor from sweep to sweep. Writes in place; no allocation.
class SweepAssembler {
 public:
  SweepAssembler(const AssembleOptions& options, LidarModel model, SweepSink& sink, LidarCounters& counters);

  void add(const DecodedPacket& packet, const PacketTiming& timing) noexcept;
  /// End of the input: hands over the sweep under way, as incomplete.
  void finish() noexcept;

 private:
  void turn_to(std::uint16_t azimuth_cdeg, bool torn, SensorTime group_start) noexcept;
  void begin_sweep(SensorTime start, bool whole) noexcept;
  void end_sweep(bool whole) noexcept;
  void append(const DecodedPacket& packet, const DecodedPacket::Group& group, SensorTime first_firing,
              SensorTime group_end) noexcept;

  int cut_cdeg_;
  std::uint32_t group_span_ns_, max_groups_;
  SweepSink& sink_;
  LidarCounters& counters_;

  Sweep* sweep_ = nullptr;  ///< being filled; null: no slot was free, the head stands, or nothing came yet
  bool whole_ = false;      ///< so far `sweep_` lacks nothing
  bool turning_ = false;    ///< position_cdeg_ and last_time_ mean something
  std::uint32_t sweep_group_count_ = 0;
  int position_cdeg_ = 0;  ///< turned since the last cut; below 0 by jitter
  SensorTime last_time_;   ///< of the last firing taken
  std::uint64_t next_index_ = 0;
};

}  // namespace roadvec
