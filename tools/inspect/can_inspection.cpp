#include "tools/inspect/can_inspection.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>

#include "drivers/can/can_capture_reader.h"

namespace roadvec {
namespace {

constexpr double kMovesWithSpeed = 0.95;

/// Range of a signal, and the sums of its correlation with the speed.
struct SignalSums {
  std::string name, unit;
  SignalDecoder decoder;
  std::uint64_t count = 0;
  double least = 0, most = 0;
  double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;

  void add(double value, std::optional<double> speed) {
    least = count == 0 ? value : std::min(least, value);
    most = count == 0 ? value : std::max(most, value);
    ++count;
    if (!speed) return;
    ++n, x += value, y += *speed, xx += value * value, yy += *speed * *speed, xy += value * *speed;
  }
  [[nodiscard]] double correlation() const {
    const double spread = (n * xx - x * x) * (n * yy - y * y);
    return n < 10 || !(spread > 1e-9 * n * n) ? 0 : (n * xy - x * y) / std::sqrt(spread);
  }
  [[nodiscard]] SignalFinding finding() const { return {name, unit, count, least, most, correlation()}; }
};

struct IdSums {
  CanIdFinding finding;
  std::vector<SignalSums> signals;
};

class Inspector {
 public:
  explicit Inspector(const DbcFile& dbc) : dbc_(dbc) {}

  Expected<void> compare_with(const std::string& speed_signal) {
    if (speed_signal.empty()) return {};
    const Expected<DbcSignalRef> found = find_signal(dbc_, speed_signal);
    if (!found) return tl::unexpected(found.error());
    const Expected<SignalDecoder> decoder = SignalDecoder::create(*found->message, *found->signal);
    if (!decoder) return tl::unexpected(decoder.error());
    speed_id_ = found->message->id;
    speed_decoder_ = *decoder;
    return {};
  }

  void add(const CanFrame& frame) {
    const CanId id{frame.id, frame.extended};
    if (speed_id_ == id) {
      if (const std::optional<double> speed = speed_decoder_.physical(frame)) speed_ = speed;
    }
    IdSums& sums = sums_of(id);
    sums.finding.least_bytes = std::min(sums.finding.least_bytes, frame.length);
    sums.finding.most_bytes = std::max(sums.finding.most_bytes, frame.length);
    sums.finding.fd = sums.finding.fd || frame.fd;
    sums.finding.stream.add(frame.time);
    for (SignalSums& signal : sums.signals) {
      if (const std::optional<double> value = signal.decoder.physical(frame)) signal.add(*value, speed_);
    }
  }

  void finish(CanInspection& result) {
    for (auto& [id, sums] : ids_) {
      for (const SignalSums& signal : sums.signals) sums.finding.signals.push_back(signal.finding());
      result.ids.push_back(std::move(sums.finding));
    }
    for (const DbcMessage& message : dbc_.messages) {
      if (!ids_.contains(message.id)) result.missing_messages.push_back(message.name);
    }
  }

 private:
  IdSums& sums_of(CanId id) {
    const auto [entry, is_new] = ids_.try_emplace(id);
    if (!is_new) return entry->second;
    IdSums& sums = entry->second;
    sums.finding.id = id;
    const auto message = std::ranges::find_if(dbc_.messages, [&](const DbcMessage& m) { return m.id == id; });
    if (message == dbc_.messages.end()) return sums;
    sums.finding.name = message->name;
    for (const DbcSignal& signal : message->signals) {
      // One that cannot be taken out (extended multiplexing) is left out of the comparison.
      const Expected<SignalDecoder> decoder = SignalDecoder::create(*message, signal);
      if (decoder) sums.signals.push_back({.name = signal.name, .unit = signal.unit, .decoder = *decoder});
    }
    return sums;
  }

  const DbcFile& dbc_;
  std::map<CanId, IdSums> ids_;
  std::optional<CanId> speed_id_;
  SignalDecoder speed_decoder_;
  std::optional<double> speed_;
};

std::string id_text(CanId id) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), id.extended ? "%08" PRIX32 : "%03" PRIX32, id.id);
  return text.data();
}

}  // namespace

Expected<CanInspection> inspect_can(const CanInspectionOptions& options) {
  CanInspection result;
  result.path = options.log;
  DbcFile dbc;
  if (!options.dbc.empty()) {
    Expected<DbcFile> loaded = load_dbc(options.dbc);
    if (!loaded) return tl::unexpected(loaded.error());
    dbc = std::move(*loaded);
    for (const DbcDiagnostic& diagnostic : dbc.diagnostics) result.warnings.push_back(diagnostic.text);
  }
  Inspector inspector(dbc);
  if (const auto compared = inspector.compare_with(options.speed_signal); !compared)
    return tl::unexpected(compared.error());
  auto reader = open_can_log(options.log);
  if (!reader) return tl::unexpected(reader.error());
  CanFrame frame;
  CanReadResult read{};
  while ((read = (*reader)->read(frame, {})) == CanReadResult::frame) {
    result.stream.add(frame.time);
    if (!frame.error && !frame.remote) inspector.add(frame);
  }
  inspector.finish(result);
  result.counters = (*reader)->counters();
  if (read == CanReadResult::failed) result.warnings.push_back(options.log + ": cannot be read to its end");
  if (result.counters.bad_line_count > 0) {
    result.warnings.push_back(options.log + ": " + std::to_string(result.counters.bad_line_count) +
                              " lines hold no frame, the first is line " +
                              std::to_string(result.counters.first_bad_line) + " (" +
                              std::string((*reader)->first_bad_line_reason()) + ")");
  }
  return result;
}

void print_text(const CanInspection& i, std::FILE* out) {
  std::fprintf(out, "CAN %s\n", i.path.c_str());
  std::fprintf(out, "  frames         %" PRIu64 " in %.3f s, %zu ids; %" PRIu64 " error frames, %" PRIu64 " dropped\n",
               i.counters.frame_count, i.stream.duration_s(), i.ids.size(), i.counters.error_frame_count,
               i.counters.kernel_drop_count);
  for (const CanIdFinding& id : i.ids) {
    std::fprintf(out, "  %-8s %-24s %2d%s bytes  %s\n", id_text(id.id).c_str(), id.name.empty() ? "-" : id.name.c_str(),
                 id.most_bytes, id.least_bytes == id.most_bytes ? "" : "-", id.stream.text().c_str());
    for (const SignalFinding& signal : id.signals) {
      if (std::abs(signal.correlation) < kMovesWithSpeed) continue;
      std::fprintf(out, "             %-28s %10.3f to %.3f %s, moves with the speed (%+.3f)\n", signal.name.c_str(),
                   signal.least, signal.most, signal.unit.c_str(), signal.correlation);
    }
  }
  for (const std::string& name : i.missing_messages) {
    std::fprintf(out, "  %-8s %-24s in the DBC file, but not on the bus\n", "-", name.c_str());
  }
}

nlohmann::ordered_json json_of(const CanInspection& i) {
  nlohmann::ordered_json json{{"path", i.path},
                              {"stream", i.stream.json()},
                              {"error_frames", i.counters.error_frame_count},
                              {"bad_lines", i.counters.bad_line_count},
                              {"kernel_drops", i.counters.kernel_drop_count}};
  json["ids"] = nlohmann::ordered_json::array();
  for (const CanIdFinding& id : i.ids) {
    nlohmann::ordered_json entry{{"id", id_text(id.id)},          {"extended", id.id.extended},  {"message", id.name},
                                 {"least_bytes", id.least_bytes}, {"most_bytes", id.most_bytes}, {"fd", id.fd},
                                 {"stream", id.stream.json()}};
    for (const SignalFinding& signal : id.signals) {
      entry["signals"][signal.name] = {{"unit", signal.unit},
                                       {"count", signal.count},
                                       {"least", signal.least},
                                       {"most", signal.most},
                                       {"correlation", signal.correlation},
                                       {"moves_with_speed", std::abs(signal.correlation) >= kMovesWithSpeed}};
    }
    json["ids"].push_back(std::move(entry));
  }
  json["missing_messages"] = i.missing_messages;
  return json;
}

}  // namespace roadvec
