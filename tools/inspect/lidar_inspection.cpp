#include "tools/inspect/lidar_inspection.h"

#include <algorithm>
#include <cinttypes>
#include <memory>

#include "drivers/recording/capture_file.h"
#include "drivers/velodyne/calibration.h"
#include "drivers/velodyne/pcap_reader.h"
#include "drivers/velodyne/sweep_decoder.h"

namespace roadvec {
namespace {

/// Writes every sweep's points as CSV and notes what the report needs.
class SweepRecorder final : public SweepSink {
 public:
  SweepRecorder(LidarModel model, std::FILE* points) : points_(points) {
    slot_.returns.reserve(max_returns_per_sweep(model));
    if (points_ != nullptr) std::fputs("sweep,x_m,y_m,z_m,intensity,t_ns,laser,return\n", points_);
  }
  Sweep* claim() noexcept override { return &slot_; }
  void publish() noexcept override {
    ++sweep_count;
    return_count += slot_.returns.size();
    if (slot_.complete) {
      if (return_counts.empty()) first_complete = slot_.returns;
      return_counts.push_back(slot_.returns.size());
      rates_hz.push_back(1.0 / std::max(seconds_between(slot_.start, slot_.end), 1e-3));
    } else if (first_complete.empty() && slot_.returns.size() > longest_part.size()) {
      longest_part = slot_.returns;
    }
    if (points_ == nullptr) return;
    for (const Return& r : slot_.returns) {
      std::fprintf(points_, "%" PRIu64 ",%.4f,%.4f,%.4f,%d,%" PRId64 ",%d,%d\n", slot_.index,
                   static_cast<double>(r.x_m), static_cast<double>(r.y_m), static_cast<double>(r.z_m), r.intensity,
                   slot_.start.ns + r.time_ns, r.laser, static_cast<int>(r.kind));
    }
  }

  std::vector<std::size_t> return_counts;  ///< of the complete revolutions
  std::vector<double> rates_hz;            ///< likewise
  std::vector<Return> first_complete, longest_part;
  std::size_t sweep_count = 0;
  std::uint64_t return_count = 0;

 private:
  Sweep slot_;
  std::FILE* points_;
};

template <class T>
T median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

bool is_data(const Traffic& traffic, int port) {
  return traffic.length == kPacketBytes && (port == 0 || traffic.port == port);
}

/// Who sends what, before anything is decided about it.
Expected<void> survey_traffic(const LidarInspectionOptions& options, LidarInspection& result) {
  Expected<CaptureFile> file = CaptureFile::open(options.pcap);
  if (!file) return tl::unexpected(file.error());
  CaptureFile::Frame frame;
  while (file->next(frame) == CaptureFile::Next::frame) {
    const CapturedFrame parsed = parse_frame(file->link(), frame.bytes);
    if (!parsed.datagram) {
      ++result.other_frame_count;
      continue;
    }
    ++result.traffic[{parsed.datagram->source_ipv4, parsed.datagram->destination_port, parsed.datagram->length}];
  }
  return {};
}

/// The sensor that is looked at: the named one, or the one with the most packets.
Expected<std::uint32_t> choose_source(const LidarInspectionOptions& options, LidarInspection& result) {
  std::uint64_t most = 0;
  std::uint32_t source = 0;
  std::string all;
  std::size_t count = 0;
  for (const auto& [traffic, packets] : result.traffic) {
    if (!is_data(traffic, options.port)) continue;
    const std::string address = ipv4_text(traffic.source_ipv4);
    all += (count++ > 0 ? ", " : "") + address;
    if (packets > most || address == options.source) {
      source = traffic.source_ipv4;
      most = address == options.source ? UINT64_MAX : packets;
    }
  }
  if (count == 0) {
    std::string other;
    for (const auto& [traffic, packets] : result.traffic) {
      if (traffic.length == kPacketBytes) other = "; packets of its length go to port " + std::to_string(traffic.port);
    }
    return fail(options.pcap + ": no data packets to UDP port " + std::to_string(options.port) + other +
                "; try --port 0 for any port");
  }
  if (!options.source.empty() && ipv4_text(source) != options.source) {
    return fail(options.pcap + ": no data packets from " + options.source + "; they come from " + all);
  }
  if (count > 1 && options.source.empty()) {
    result.warnings.push_back("more than one sensor sends to the port: " + all + "; this is about " +
                              ipv4_text(source) + ". Choose with --source, and set lidar.source_address in the car");
  }
  return source;
}

Expected<Survey> first_packets(const LidarInspectionOptions& options, const PcapReaderOptions& reader_options) {
  constexpr std::size_t kEnough = 512;
  LidarCounters counters;
  auto reader = PcapReader::open(options.pcap, reader_options, counters);
  if (!reader) return tl::unexpected(reader.error());
  std::vector<RawPacket> packets;
  std::span<const RawPacket> batch;
  while (packets.size() < kEnough && (*reader)->read(batch, {}) == ReadResult::packets) {
    packets.insert(packets.end(), batch.begin(), batch.end());
  }
  return survey(packets);
}

/// Model and calibration to decode with. Nothing, and why in `not_decoded`, where nobody said and they cannot be known.
struct Decoding {
  LidarModel model{};
  Calibration calibration;
};
Expected<std::optional<Decoding>> decoding_for(const LidarInspectionOptions& options, LidarInspection& result) {
  const std::string seen = result.seen_model ? std::string(model_text(*result.seen_model)) : "";
  if (options.model.empty() && seen.empty()) {
    result.not_decoded = "the packets fit no model known here; say --model NAME if you know it";
    return std::optional<Decoding>();
  }
  const std::string name = options.model.empty() ? seen : options.model;
  const Expected<LidarModel> model = lidar_model_from(name);
  if (!model && !options.model.empty()) return tl::unexpected(model.error());
  if (!model) {
    result.not_decoded = model.error().message;
    return std::optional<Decoding>();
  }
  if (const std::string reason = misfit(result.survey, *model); !reason.empty()) {
    return fail(options.pcap + ": not the packets of a " + name + ": " + reason +
                (seen.empty() ? "" : "; they look like those of a " + seen));
  }
  Expected<Calibration> calibration = calibration_for(*model, options.calibration);
  if (!calibration && (!options.calibration.empty() || !options.model.empty()))
    return tl::unexpected(calibration.error());
  if (!calibration) {
    result.not_decoded = "a " + name + " needs its db.xml: say --calibration FILE, or streamed";
    return std::optional<Decoding>();
  }
  return std::optional<Decoding>({*model, std::move(*calibration)});
}

void note_sweeps(const SweepRecorder& recorder, LidarInspection& result) {
  result.sweeps = recorder.sweep_count;
  result.returns = recorder.return_count;
  result.complete_sweeps = recorder.return_counts.size();
  result.picture = recorder.return_counts.empty() ? recorder.longest_part : recorder.first_complete;
  if (recorder.return_counts.empty()) return;
  result.least_returns = std::ranges::min(recorder.return_counts);
  result.most_returns = std::ranges::max(recorder.return_counts);
  result.median_returns = median(recorder.return_counts);
  result.median_rate_hz = median(recorder.rates_hz);
}

void read_all(PcapReader& reader, const LidarInspectionOptions& options, SweepDecoder* decoder,
              LidarInspection& result) {
  SensorClock clock;
  std::span<const RawPacket> batch;
  ReadResult read{};
  while ((read = reader.read(batch, {})) == ReadResult::packets) {
    for (const RawPacket& packet : batch) {
      result.stream.add(packet.arrived);
      if (decoder != nullptr) decoder->add(packet);
      if (options.progress && result.stream.count() % 20'000 == 0)
        std::fprintf(stderr, "\r%" PRIu64 " packets", result.stream.count());
    }
    for (const RawPositionPacket& packet : reader.positions()) clock.add(packet);
  }
  if (decoder != nullptr) decoder->finish();
  if (options.progress && result.stream.count() >= 20'000) std::fputs("\r\033[K", stderr);
  if (read == ReadResult::failed) result.damage = reader.error();
  if (!reader.warning().empty()) result.warnings.emplace_back(reader.warning());
  result.gps = clock.report();
}

/// A second reading, so that the report's own does not depend on it.
Expected<LidarStatistics> gather_statistics(const LidarInspectionOptions& options,
                                            const PcapReaderOptions& reader_options, const Decoding& decoding) {
  LidarCounters counters;
  auto reader = PcapReader::open(options.pcap, reader_options, counters);
  if (!reader) return tl::unexpected(reader.error());
  StatisticsCollector collector(decoding.model);
  SweepDecoder decoder(decoding.model, decoding.calibration, {}, collector, counters);
  std::span<const RawPacket> batch;
  while ((*reader)->read(batch, {}) == ReadResult::packets) {
    for (const RawPacket& packet : batch) {
      decoder.add(packet);
      if (decoder.calibrated()) collector.add(packet, decoder.last_packet());
    }
  }
  return collector.figures();
}

void note_oddities(LidarInspection& result) {
  const Survey& survey = result.survey;
  if (result.seen_model && survey.bank_count != 2 && claimed_model(survey) != model_text(*result.seen_model)) {
    result.warnings.push_back("the packets claim " + claimed_model(survey) + " and are built as those of a " +
                              std::string(model_text(*result.seen_model)) +
                              ": old firmware; the configured model rules");
  }
  if (result.counts.fragments > 0)
    result.warnings.emplace_back("some packets are IP fragments, which are not put together: raise the network's MTU");
  if (result.counts.cut_short > 0)
    result.warnings.emplace_back("some packets were cut by the capture's snap length: capture with tcpdump -s 0");
  if (keeps_utc(result.gps) == false)
    result.warnings.emplace_back(
        "the sensor's stamps are not UTC although its GPS has a fix: not for clock device_utc");
  if (result.gps.thermal_shutdown) result.warnings.emplace_back("the sensor says it is too hot and has stopped firing");
}

}  // namespace

Expected<LidarInspection> inspect_lidar(const LidarInspectionOptions& options) {
  LidarInspection result;
  result.path = options.pcap;
  if (const auto surveyed = survey_traffic(options, result); !surveyed) return tl::unexpected(surveyed.error());
  const Expected<std::uint32_t> source = choose_source(options, result);
  if (!source) return tl::unexpected(source.error());
  const PcapReaderOptions reader_options{.port = options.port, .source_ipv4 = *source};
  const Expected<Survey> seen = first_packets(options, reader_options);
  if (!seen) return tl::unexpected(seen.error());
  result.survey = *seen;
  result.seen_model = likely_model(*seen);
  const auto decoding = decoding_for(options, result);
  if (!decoding) return tl::unexpected(decoding.error());

  LidarCounters counters;
  auto reader = PcapReader::open(options.pcap, reader_options, counters);
  if (!reader) return tl::unexpected(reader.error());
  if (*decoding) {
    result.model = name_of((*decoding)->model);
    SweepRecorder recorder((*decoding)->model, options.points);
    SweepDecoder decoder((*decoding)->model, (*decoding)->calibration, {}, recorder, counters);
    read_all(**reader, options, &decoder, result);
    result.stamps = decoder.clock().state();
    result.other_product_id_count = decoder.decoder().other_product_id_count();
    if (result.survey.bank_count == 2) result.status = decoder.status();
    note_sweeps(recorder, result);
    if (options.statistics) {
      auto statistics = gather_statistics(options, reader_options, **decoding);
      if (!statistics) return tl::unexpected(statistics.error());
      result.statistics = std::move(*statistics);
      result.statistics->path = options.pcap;
    }
  } else {
    read_all(**reader, options, nullptr, result);
  }
  result.counts = snapshot(counters);
  note_oddities(result);
  return result;
}

}  // namespace roadvec
