#include <CLI/CLI.hpp>
#include <cstdlib>

#include "tools/replay/replay.h"

namespace roadvec {
namespace {

constexpr int kUsageError = 2;

constexpr const char* kAbout =
    "Plays a recorded drive as live traffic, for a roadvecd that runs as it does in the car.\n\n"
    "The drive's packets go out over UDP. Its CAN frames go to a CAN interface or a pipe, the bytes of its IMU to a\n"
    "pseudo-terminal or over UDP, if asked for. All are merged by their recorded stamps and sent at their due time.";

constexpr const char* kMore = R"(OUTPUTS
  A recording without an output is not played. Pipe and terminal are made at the start and removed at the end; the
  replay begins once their readers have opened them, so that nothing of the beginning is lost.

  --can needs an interface that is up:  ip link add vcan0 type vcan && ip link set vcan0 up
  --can-pipe serves hosts without CAN. The lines carry the date at which each frame is due now, not that of the
  recording, as `candump -L` would write them. In roadvecd's configuration:  can = "/run/roadvec/can.fifo"
  --imu-pty stands for the serial line of the device:  device = "/run/roadvec/imu"
  --imu-udp stands for a device that sends datagrams (NCOM): one for each line of imu.log.

TIME
  The receivers stamp what arrives themselves. At --speed other than 1 they see a vehicle that moves by its wheels at
  one speed and through the world at another: good for load tests, not for maps.
  A receiver that is full or absent loses what is due, as on a real bus; it is counted as lost. With
  --as-fast-as-possible pipes, terminal and interface are waited for instead; UDP has no way to tell.

OUTPUT
  What is played, once a second on a terminal how far it is, and at the end for each recording: items and bytes sent,
  items lost (no listener, receiver full), and items skipped (damaged, other traffic, error frames); the achieved
  rate, and the worst lateness of an item. --json prints the end alone, as one object.

EXAMPLES
  roadvec-replay drives/town
  roadvec-replay drives/town --can vcan0 --imu-pty /run/roadvec/imu
  roadvec-replay drives/town --can-pipe /tmp/can.fifo --from 20 --to 40 --loop
  roadvec-replay drives/town --udp 192.168.1.77:2368 --speed 3 --json

EXIT STATUS
  0  played, to the end or to a SIGINT or SIGTERM
  1  the drive cannot be read, or an output cannot be opened
  2  the command line is wrong

SEE ALSO
  roadvecd(8), roadvec-inspect(1), candump(1))";

void take_endpoint(CLI::App& app, const char* name, const char* meaning, std::optional<Endpoint>& endpoint) {
  app.add_option_function<std::string>(
         name,
         [&endpoint, name](const std::string& text) {
           auto parsed = Endpoint::parse(text);
           if (!parsed) throw CLI::ValidationError(name, parsed.error().message);
           endpoint = *parsed;
         },
         meaning)
      ->option_text("HOST:PORT");
}

/// --help and --version print and end the program; a wrong line says why and ends it with status 2.
ReplayOptions parse_command_line(int argc, char** argv) {
  ReplayOptions options;
  std::optional<Endpoint> udp;
  CLI::App app(kAbout, "roadvec-replay");
  app.footer(kMore);
  app.get_formatter()->column_width(30);
  app.set_version_flag("--version", std::string("roadvec-replay ") + ROADVEC_VERSION, "print the version and end");
  app.set_help_flag("-h,--help", "print this and end");
  app.add_option("DIR", options.drive, "the drive: a folder with drive.toml, lidar.pcap, can.log, imu.log")
      ->required()
      ->option_text(" ");
  take_endpoint(app, "--udp", "where the packets go; default 127.0.0.1:2368", udp);
  app.add_option("--position-port", options.position_port,
                 "where the sensor's position packets go on the same host; 0: nowhere; default 8308")
      ->check(CLI::Range(0, 65535))
      ->option_text("PORT");
  app.add_option("--can", options.can, "CAN interface to send the frames on")->option_text("IFACE");
  app.add_option("--can-pipe", options.can_pipe, "FIFO to write the frames to, as candump -L lines")
      ->option_text("PATH");
  app.add_option("--imu-pty", options.imu_pty, "symbolic link to make to a pseudo-terminal that speaks as the IMU")
      ->option_text("PATH");
  take_endpoint(app, "--imu-udp", "where datagrams of the IMU go", options.imu_udp);
  auto* const speed =
      app.add_option("--speed", options.plan.speed, "times as fast as recorded, 0.01 to 1000; default 1")
          ->check(CLI::Range(0.01, 1000.0))
          ->option_text("X");
  auto* const fast = app.add_flag("--as-fast-as-possible", options.plan.as_fast_as_possible,
                                  "do not wait for due times; not with --speed");
  app.add_flag("--loop", options.plan.loop, "begin again at the end, until SIGINT or SIGTERM");
  app.add_option("--from", options.plan.from_s, "skip what is before, in seconds from the drive's first stamp")
      ->check(CLI::Range(0.0, 1e9))
      ->option_text("S");
  app.add_option("--to", options.plan.to_s, "end there, in seconds from the drive's first stamp")
      ->check(CLI::Range(0.0, 1e9))
      ->option_text("S");
  app.add_flag("--json", options.json, "print one JSON object at the end, nothing else");
  try {
    app.parse(argc, argv);
    if (*speed && *fast) throw CLI::ValidationError("--speed", "and --as-fast-as-possible exclude each other");
    if (options.plan.to_s < options.plan.from_s) throw CLI::ValidationError("--to", "lies before --from");
  } catch (const CLI::ParseError& end) {
    std::exit(app.exit(end) == 0 ? EXIT_SUCCESS : kUsageError);
  }
  if (udp) options.udp = *udp;
  return options;
}

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) { return roadvec::replay(roadvec::parse_command_line(argc, argv)); }
