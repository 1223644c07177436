#pragma once

#include <optional>
#include <string>

#include "daemon/server/client.h"

namespace roadvec {

/// Exit codes of `roadvec`: part of its interface, named in --help.
enum ExitCode : int { kExitOk = 0, kExitFailure = 1, kExitUsage = 2, kExitNoDaemon = 3, kExitDegraded = 4 };

struct Connection {
  std::string socket_path = "/run/roadvec/map.sock";
  double timeout_s = 5;
  bool json = false;
};
struct TileChoice {
  std::optional<wire::Area> area;
  double around_vehicle_m = 0;
};
struct WatchChoice {
  std::optional<wire::Area> area;
  bool poses = false, status = false;
  double max_rate_hz = 0;
  std::uint64_t message_count = 0;  ///< 0: until the daemon says Bye
};

struct StatusChoice {
  bool watch = false;  ///< again and again, until the program is ended
  double interval_s = 1;
};

enum class ExportFormat : std::uint8_t { gpkg, geojson, lanelet2 };
struct ExportChoice {
  ExportFormat format = ExportFormat::geojson;
  std::string output_path;
  std::string map_file;   ///< empty: the daemon's map
  std::int64_t part = 0;  ///< of the file; 0: the newest
};

// Each command prints its result, or one line on standard error, and gives the exit code.
[[nodiscard]] int show_status(const Connection& connection, const StatusChoice& choice);
[[nodiscard]] int show_metrics(const Connection& connection);
/// On the control socket.
[[nodiscard]] int control(const Connection& connection, const wire::Command& command);
[[nodiscard]] int list_tiles(const Connection& connection, const TileChoice& choice);
[[nodiscard]] int watch(const Connection& connection, const WatchChoice& choice);
[[nodiscard]] int export_map(const Connection& connection, const ExportChoice& choice);
[[nodiscard]] int render_svg(const Connection& connection, const std::string& output_path, const std::string& title);

/// "x_min,y_min,x_max,y_max" in metres.
[[nodiscard]] Expected<wire::Area> parse_area(const std::string& text);

/// 24 lines of 80 columns at most.
[[nodiscard]] std::string status_screen(const wire::Status& status);

// Shared by the commands.
[[nodiscard]] Expected<MapClient> connect(const Connection& connection);
[[nodiscard]] int complain(const Error& error, int exit_code);

}  // namespace roadvec
