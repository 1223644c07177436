#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "drivers/can/can_reader.h"
#include "drivers/can/dbc.h"
#include "drivers/can/signals.h"
#include "tools/inspect/stream_stats.h"

namespace roadvec {

struct CanInspectionOptions {
  std::string log;
  std::string dbc;           ///< empty: ids alone
  std::string speed_signal;  ///< "Message.Signal" that the others are compared with; empty: they are not
};

/// One signal of the DBC file: its range, and whether it moves with the speed.
struct SignalFinding {
  std::string name, unit;
  std::uint64_t count = 0;
  double least = 0, most = 0;
  double correlation = 0;  ///< with the speed signal, -1 to 1; 0: does not move, or was not compared
};

struct CanIdFinding {
  CanId id;
  std::string name;  ///< of the message; empty: not in the DBC file
  std::uint8_t least_bytes = 64, most_bytes = 0;
  bool fd = false;
  StreamStats stream;
  std::vector<SignalFinding> signals;
};

struct CanInspection {
  std::string path;
  CanCounters counters;
  StreamStats stream;
  std::vector<CanIdFinding> ids;              ///< by id
  std::vector<std::string> missing_messages;  ///< in the DBC file and not in the log
  std::vector<std::string> warnings;
};

[[nodiscard]] Expected<CanInspection> inspect_can(const CanInspectionOptions& options);
void print_text(const CanInspection& inspection, std::FILE* out);
[[nodiscard]] nlohmann::ordered_json json_of(const CanInspection& inspection);

}  // namespace roadvec
