#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "drivers/velodyne/pcap_reader.h"
#include "drivers/velodyne/sweep_decoder.h"
#include "tools/inspect/survey.h"

namespace roadvec {

/// Writes every sweep's points as CSV and notes what the report needs.
class SweepRecorder final : public SweepSink {
 public:
  /// `points`: where the CSV goes; null: nowhere.
  SweepRecorder(LidarModel model, std::FILE* points);
  Sweep* claim() noexcept override { return &slot_; }
  void publish() noexcept override;

  std::vector<std::size_t> return_counts;  ///< of the complete revolutions
  std::vector<double> rates_hz;            ///< likewise
  std::size_t sweep_count = 0;
  std::uint64_t return_count = 0;

 private:
  Sweep slot_;
  std::FILE* points_;
};

/// What roadvec-inspect found in one recording.
struct Inspection {
  std::string path;
  LidarModel model{};
  Survey survey;
  LidarCounts counts;
  std::uint64_t position_packets = 0, fragments = 0, other_frames = 0, other_product_id = 0;
  std::size_t sweeps = 0, complete_sweeps = 0;
  std::uint64_t returns = 0;
  std::size_t least_returns = 0, median_returns = 0, most_returns = 0;  ///< of complete revolutions
  double median_rate_hz = 0;                                            ///< of complete revolutions
  SensorTime first_arrived, last_arrived;
  /// Arrival minus device stamp, modulo the hour; an HDL-64E with about 288 us stamps its first firing.
  std::int64_t least_delay_ns = 0, most_delay_ns = 0;
  Hdl64Status status;  ///< at the end; of an HDL-64E alone
  std::string damage;  ///< why the recording could not be read to its end

  [[nodiscard]] double duration_s() const { return seconds_between(first_arrived, last_arrived); }
};

/// Reads the whole recording. `progress`: tell stderr how far.
[[nodiscard]] Inspection inspect(PcapReader& reader, const std::string& path, const Survey& survey, LidarModel model,
                                 const Calibration& calibration, LidarCounters& counters, std::FILE* points,
                                 bool progress);

void print_text(const Inspection& inspection, std::FILE* out);
void print_json(const Inspection& inspection, std::FILE* out);

}  // namespace roadvec
