#pragma once

#include "drivers/velodyne/assemble.h"
#include "drivers/velodyne/counters.h"
#include "drivers/velodyne/decode.h"
#include "drivers/velodyne/hdl64_status.h"
#include "drivers/velodyne/packet_clock.h"

namespace roadvec {

struct SweepDecoderOptions {
  DecodeOptions decode{};
  PacketClockOptions clock{};
  AssembleOptions assemble{};
};

/// Packets in, sweeps out: decoder, clock and assembler in a row. What the lidar thread, the tools and the tests all
/// run. Where the calibration is the one that the sensor streams, sweeps begin when it is complete. Pure; after the
/// constructor it neither allocates nor throws.
class SweepDecoder {
 public:
  SweepDecoder(LidarModel model, const Calibration& calibration, const SweepDecoderOptions& options, SweepSink& sink,
               LidarCounters& counters)
      : decoder_(model, calibration, options.decode, counters),
        clock_(options.clock, counters),
        assembler_(options.assemble, model, sink, counters),
        counters_(counters),
        has_status_(!facts_of(model).has_return_mode),
        calibrated_(!calibration.streamed) {}

  void add(const RawPacket& packet) noexcept;
  /// End of the input: the sweep under way is handed over as incomplete.
  void finish() noexcept { assembler_.finish(); }

  /// The packet last added; for reports.
  [[nodiscard]] const DecodedPacket& last_packet() const { return decoded_; }
  [[nodiscard]] const PacketClock& clock() const { return clock_; }
  [[nodiscard]] const PacketDecoder& decoder() const { return decoder_; }
  [[nodiscard]] bool calibrated() const { return calibrated_; }
  /// Of an HDL-64E; other heads say nothing.
  [[nodiscard]] const Hdl64Status& status() const { return status_; }

 private:
  PacketDecoder decoder_;
  PacketClock clock_;
  SweepAssembler assembler_;
  Hdl64Status status_;
  LidarCounters& counters_;
  bool has_status_, calibrated_;
  DecodedPacket decoded_;
};

}  // namespace roadvec
