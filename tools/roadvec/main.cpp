#include <CLI/CLI.hpp>
#include <exception>

#include "tools/roadvec/commands.h"

namespace {

constexpr const char* kDescription =
    "roadvec - look at the map of a running roadvecd\n\n"
    "Connects to the daemon's map socket, reads the map of the road's boundaries or the daemon's state, and prints it "
    "or writes it\n"
    "to a file. Nothing it does makes the daemon wait, and nothing but 'roadvec control' changes the map.";

constexpr const char* kFooter = R"(
COMMANDS IN SHORT
  roadvec status                     one screen: sensors, pose, map, disk, threads, latency, and what is wrong
  roadvec status --watch             the same, again every second, until Ctrl-C
  roadvec status --json              the same and every counter, for scripts
  roadvec metrics                    counters, gauges and times as OpenMetrics text
  roadvec tiles --around 100         the 64 m tiles within 100 m of the vehicle
  roadvec watch --poses --json       every change and pose as it comes, one JSON object per line
  roadvec export geojson -o map.geojson
  roadvec export lanelet2 -o map.osm --map /var/lib/roadvec/map.gpkg
  roadvec render -o map.svg
  sudo roadvec control save          wait until all changes so far are on disk; status 1
                                     at once while nothing can be written there
  sudo roadvec control new-map       let go of the map, which stays on disk, and begin an empty one

EXIT STATUS
  0  done
  1  the daemon answered with an error, fell silent, or a file could not be written
  2  wrong usage
  3  no daemon answers on the socket
  4  status: the daemon answers, but is not as it should be: the map does not
     grow, a sensor is silent, the disk is full, ... (the state is not "mapping")

ENVIRONMENT
  ROADVEC_SOCKET           the map socket, when --socket is not given
  ROADVEC_CONTROL_SOCKET   the control socket, when --control-socket is not given

FILES
  /run/roadvec/map.sock               the map socket; reading it takes membership in its group
  /run/roadvec/control.sock           the control socket: for the daemon's own user and root
  /usr/share/roadvec/roadvec.proto    the protocol, for programs of your own

UNITS
  Metres and degrees for people; JSON carries the units of the protocol (millimetres, radians) in its names.
  The map frame is East (x), North (y), Up (z) at the anchor.)";

roadvec::wire::Area area_of(const std::string& text) {
  auto area = roadvec::parse_area(text);
  if (!area) throw CLI::ValidationError("--area", area.error().message);
  return *area;
}

}  // namespace

int main(int argc, char** argv) try {
  roadvec::Connection connection;
  roadvec::TileChoice tiles;
  roadvec::WatchChoice watch;
  roadvec::StatusChoice look;
  roadvec::ExportChoice choice;
  std::string svg_path = "map.svg", title = "roadvec map";
  int exit_code = roadvec::kExitUsage;

  CLI::App app(kDescription, "roadvec");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec " ROADVEC_VERSION);
  app.require_subcommand(1);
  app.fallthrough();
  app.add_option("-s,--socket", connection.socket_path, "the daemon's map socket")
      ->envname("ROADVEC_SOCKET")
      ->capture_default_str();
  app.add_option("--timeout", connection.timeout_s, "seconds to wait for an answer")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  app.add_flag("--json", connection.json, "print JSON, one object per line");

  CLI::App* status = app.add_subcommand("status", "how the daemon and each of its parts are, on one screen");
  CLI::Option* again = status->add_flag("--watch", look.watch, "draw it again and again, until Ctrl-C");
  status->add_option("--interval", look.interval_s, "seconds between two of --watch")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str()
      ->needs(again);
  status->callback([&] { exit_code = roadvec::show_status(connection, look); });

  CLI::App* metrics = app.add_subcommand("metrics", "counters, gauges and times of every stage as OpenMetrics text");
  metrics->callback([&] { exit_code = roadvec::show_metrics(connection); });

  CLI::App* list = app.add_subcommand("tiles", "tiles of the map, with --json their whole content");
  auto* area = list->add_option_function<std::string>(
      "--area", [&](const std::string& text) { tiles.area = area_of(text); },
      "x_min,y_min,x_max,y_max in metres of the map frame");
  list->add_option("--around", tiles.around_vehicle_m,
                   "only what lies within so many metres of the vehicle, east, north, west, south")
      ->check(CLI::Range(0.1, 100'000.0))
      ->excludes(area);
  list->callback([&] { exit_code = roadvec::list_tiles(connection, tiles); });

  CLI::App* follow = app.add_subcommand("watch", "the map's changes as they come, until the daemon stops");
  follow->add_option_function<std::string>(
      "--area", [&](const std::string& text) { watch.area = area_of(text); },
      "only changes there: x_min,y_min,x_max,y_max in metres");
  follow->add_flag("--poses", watch.poses, "the vehicle's poses too");
  follow->add_flag("--status", watch.status, "the daemon's status too, once a second");
  follow
      ->add_option("--rate", watch.max_rate_hz,
                   "hold changes and poses back to so many times a second; 0: as they come")
      ->check(CLI::Range(0.0, 1000.0));
  follow->add_option("-n,--count", watch.message_count, "stop after so many messages; 0: never");
  follow->callback([&] { exit_code = roadvec::watch(connection, watch); });

  CLI::App* exporter = app.add_subcommand("export", "the whole map as a file, from the daemon or from its own file");
  exporter->require_subcommand(1);
  auto* map_file =
      exporter->add_option("--map", choice.map_file, "take this file (map.gpkg), also while no daemon runs")
          ->type_name("FILE");
  exporter->add_option("--part", choice.part, "which of the file's parts (table `parts`); 0: the newest")
      ->type_name("N")
      ->check(CLI::NonNegativeNumber)
      ->needs(map_file);
  using enum roadvec::ExportFormat;
  for (const auto& [format, name, default_path, meaning] :
       {std::tuple{gpkg, "gpkg", "map.gpkg", "GeoPackage: the map as one file for QGIS and ogr"},
        {geojson, "geojson", "-", "GeoJSON (RFC 7946): WGS 84 longitude, latitude, height"},
        {lanelet2, "lanelet2", "-", "Lanelet2 (OSM XML): curbstone and road_border, nodes with ele"}}) {
    CLI::App* command = exporter->add_subcommand(name, meaning);
    auto path = std::make_shared<std::string>(default_path);
    command->add_option("-o,--output", *path, "file to write; - is standard output (not for gpkg)")
        ->capture_default_str();
    command->callback([&, path, format = format] {
      choice.format = format;
      choice.output_path = *path;
      exit_code = roadvec::export_map(connection, choice);
    });
  }

  CLI::App* control = app.add_subcommand("control", "commands of the daemon's owner");
  control->require_subcommand(1);
  std::string control_path = "/run/roadvec/control.sock";
  control->add_option("--control-socket", control_path, "the daemon's control socket")
      ->envname("ROADVEC_CONTROL_SOCKET")
      ->capture_default_str();
  const auto command = [&](const roadvec::wire::Command& given) {
    connection.socket_path = control_path;
    exit_code = roadvec::control(connection, given);
  };
  CLI::App* save = control->add_subcommand("save", "wait until all changes so far are on disk");
  save->callback([command] { command({roadvec::wire::Save{}, std::nullopt, std::nullopt}); });
  CLI::App* new_map = control->add_subcommand(
      "new-map", "let go of the map, which stays in map.gpkg, and begin an empty one where the vehicle is");
  new_map->callback([command] { command({std::nullopt, roadvec::wire::NewMap{}, std::nullopt}); });

  CLI::App* render = app.add_subcommand("render", "a picture (SVG) of the whole map");
  render->add_option("-o,--output,output", svg_path, "file to write; - is standard output")->capture_default_str();
  render->add_option("--title", title, "heading of the picture")->capture_default_str();
  render->callback([&] { exit_code = roadvec::render_svg(connection, svg_path, title); });

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? roadvec::kExitOk : roadvec::kExitUsage;
  }
  return exit_code;
} catch (const std::exception& e) {
  return roadvec::complain({e.what()}, roadvec::kExitFailure);
}
