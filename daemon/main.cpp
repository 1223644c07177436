#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>

#include "daemon/config/config_text.h"
#include "daemon/config/load.h"
#include "daemon/daemon.h"
#include "daemon/log.h"
#include "daemon/reload.h"
#include "daemon/results.h"

namespace {

using namespace roadvec;

constexpr int kExitFailure = 1, kExitUsage = 2, kExitConfig = 78;  // EX_CONFIG: systemd does not try again

constexpr const char* kFooter = R"(
IN THE CAR
  roadvecd reads the LiDAR's UDP packets, the CAN bus and the IMU as its
  configuration says, serves the growing map on a UNIX socket, and keeps it in
  map.gpkg, a GeoPackage, which ogrinfo and QGIS open meanwhile. Every batch of
  changes is on the disk when 'roadvec status' says so. Each start adds a part to
  the file. A full disk, a lock, a file moved away: mapping goes on, the
  status says so, and it is written when the cause is gone. A damaged file is set
  aside as map-damaged-<UTC>.gpkg. SIGTERM and SIGINT end it; with --out it then
  leaves the files below too. SIGHUP reads the configuration again: log.level
  changes at once, other keys are named and wait for a restart, and a wrong file
  changes nothing. UDP ports and the map's socket are taken over where systemd
  hands them over (roadvec-lidar.socket, roadvec-map.socket,
  roadvec-control.socket), and opened where not.

RECORDED DRIVES
  With --drive it maps a recorded drive as fast as it can, writes
    map.geojson      the boundaries, WGS 84 (RFC 7946)
    map.svg          a picture of them, with the path driven
    trajectory.tum   the optimised path: t x y z qx qy qz qw, map frame
    report.json      counters, time per step (p50, p99, max), figures of the map
  into the --out directory and exits. The same drive gives the same map, to the
  byte.

EXIT STATUS
  0   done
  1   failure: input missing or damaged, port or socket in use, nothing could be
      written
  2   wrong usage
  78  wrong configuration

EXAMPLES
  roadvecd --drive drives/town --out town-map
  roadvecd --config /etc/roadvec/roadvecd.toml
  roadvecd --config my-car.toml --check-config
  roadvecd --print-config > roadvecd.toml

FILES
  /etc/roadvec/roadvecd.toml   the configuration
  /run/roadvec/map.sock        the map's socket; members of the group roadvec may connect
  /run/roadvec/control.sock    commands, for the daemon's own user and root: roadvec control
  /var/lib/roadvec/map.gpkg    the map)";

struct Arguments {
  std::string config = "/etc/roadvec/roadvecd.toml", drive, out;
  bool check_config = false, print_config = false;
};

Expected<Settings> settings_of(const Arguments& arguments, bool config_given) {
  if (arguments.drive.empty()) return load_settings(arguments.config);
  std::optional<std::filesystem::path> overrides;
  if (config_given) overrides = arguments.config;
  return load_drive(arguments.drive, overrides);
}

/// Whatever systemd hands over and no key names would fill up unread.
void warn_of_unused(const Settings& settings, const PassedSockets& sockets) {
  for (const auto& [port, fd] : sockets.udp_fds) {
    const bool for_imu = settings.imu && settings.imu->protocol == ImuProtocol::ncom && port == settings.imu->port;
    if (port == settings.lidar.port || port == settings.lidar.position_port || for_imu) continue;
    spdlog::warn(
        "systemd hands over UDP port {}, which no key of the configuration names: make ListenDatagram= of "
        "roadvec-lidar.socket and lidar.port ({}) agree",
        port, settings.lidar.port);
  }
}

int run(const Arguments& arguments, const Settings& settings, const PassedSockets& sockets) {
  const InputKind kind = arguments.drive.empty() ? InputKind::live : InputKind::recorded;
  Settings placed = settings;
  std::optional<std::filesystem::path> output;
  if (!arguments.out.empty()) {
    placed.storage.directory = *(output = arguments.out);
    if (const Expected<void> ready = make_writable(*output); !ready) throw std::runtime_error(ready.error().message);
  }
  Service service;
  warn_of_unused(settings, sockets);
  Daemon daemon(placed, kind, service, sockets);
  spdlog::info(
      "roadvecd {} started: {} {}", ROADVEC_VERSION, settings.lidar.model,
      kind == InputKind::live ? "on UDP port " + std::to_string(settings.lidar.port) : "from " + arguments.drive);
  Reload reload(arguments.config, settings);
  return daemon.run(output, [&] { return kind == InputKind::live ? reload.run() : std::string(); });
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"roadvecd: builds a vector map of the road's boundaries while driving", "roadvecd"};
  app.set_version_flag("--version", std::string("roadvecd ") + ROADVEC_VERSION);
  auto* config =
      app.add_option("--config", arguments.config, "configuration file; with --drive: overrides for the steps")
          ->type_name("FILE")
          ->capture_default_str();
  auto* drive = app.add_option("--drive", arguments.drive, "map this recorded drive and exit")->type_name("DIR");
  app.add_option("--out", arguments.out, "where the map goes, in place of storage.directory")->type_name("DIR");
  app.add_flag("--check-config", arguments.check_config, "check the configuration (or drive) and exit");
  app.add_flag("--print-config", arguments.print_config, "print every key with range, default and meaning, and exit");
  app.footer(kFooter);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitUsage;
  }
  if (arguments.print_config) {
    std::fputs(default_config_text().c_str(), stdout);
    return 0;
  }
  if (drive->count() > 0 && arguments.out.empty() && !arguments.check_config) {
    std::fputs("roadvecd: --drive needs --out DIR, where the map is to go\n", stderr);
    return kExitUsage;
  }
  try {
    const Expected<Settings> settings = settings_of(arguments, config->count() > 0);
    if (!settings) {
      std::fprintf(stderr, "%s\n", settings.error().message.c_str());
      Service::status("wrong configuration: " +
                      settings.error().message.substr(0, settings.error().message.find('\n')));
      return kExitConfig;
    }
    if (arguments.check_config) {
      std::printf("%s: ok\n", arguments.drive.empty() ? arguments.config.c_str() : arguments.drive.c_str());
      return 0;
    }
    set_up_log(settings->log);
    const Expected<PassedSockets> sockets = take_passed_sockets();
    if (!sockets) throw std::runtime_error(sockets.error().message);
    return run(arguments, *settings, *sockets);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "roadvecd: %s\n", error.what());
    Service::status(error.what());
    return kExitFailure;
  }
}
