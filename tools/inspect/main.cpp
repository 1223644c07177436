#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>

#include "daemon/config/load.h"
#include "drivers/can/asc_line.h"
#include "drivers/can/candump_line.h"
#include "drivers/imu/log_reader.h"
#include "drivers/recording/capture_file.h"
#include "drivers/recording/recording_file.h"
#include "tools/inspect/can_inspection.h"
#include "tools/inspect/imu_inspection.h"
#include "tools/inspect/lidar_inspection.h"
#include "tools/inspect/sweep_svg.h"

namespace roadvec {
namespace {

constexpr int kBadInput = 1, kBadUsage = 2;

struct Options {
  std::filesystem::path path;
  std::string calibration, model, source, points, svg, dbc, speed, imu;
  std::vector<std::filesystem::path> beside;
  bool json = false, statistics = false;
  int port = kDataPort;
};

/// What there is to look at; empty names: not there.
struct Recordings {
  LidarInspectionOptions lidar;
  CanInspectionOptions can;
  std::string imu, imu_protocol;
};

struct Report {
  std::optional<LidarInspection> lidar;
  std::optional<CanInspection> can;
  std::optional<ImuInspection> imu;
};

void take_drive(const Settings& drive, Recordings& recordings) {
  recordings.lidar.pcap = drive.lidar.pcap;
  if (recordings.lidar.calibration.empty()) recordings.lidar.calibration = drive.lidar.calibration;
  if (recordings.lidar.model.empty()) recordings.lidar.model = drive.lidar.model;
  if (recordings.lidar.source.empty()) recordings.lidar.source = drive.lidar.source_address;
  if (drive.vehicle) {
    recordings.can.log = drive.vehicle->can;
    if (recordings.can.dbc.empty()) recordings.can.dbc = drive.vehicle->dbc;
    const auto& wheels = drive.vehicle->wheel_speed_signals;
    if (recordings.can.speed_signal.empty() && !wheels.empty())
      recordings.can.speed_signal = wheels.front().sum.front();
  }
  if (drive.imu && !drive.imu->log.empty()) {
    recordings.imu = drive.imu->log;
    recordings.imu_protocol = drive.imu->protocol == ImuProtocol::ncom ? "ncom" : "xsens";
  }
}

/// A file that is no capture: by its first line that says anything.
Expected<void> take_log(const std::filesystem::path& path, const std::string& why_no_capture, Recordings& recordings) {
  recordings.imu = path.extension() == ".bin" ? path.string() : "";
  if (!recordings.imu.empty()) return {};
  Expected<RecordingFile> file = RecordingFile::open(path.string());
  if (!file) return tl::unexpected(file.error());
  std::array<std::uint8_t, kMaxImuLineBytes> bytes{};
  for (int i = 0; i < 100; ++i) {
    const auto line = file->next_line();
    if (!line) break;
    if (parse_candump_line(*line).kind == CandumpKind::frame || AscLines::is_header(*line)) {
      recordings.can.log = path;
      return {};
    }
    if (parse_imu_log_line(*line, bytes)) {
      recordings.imu = path;
      return {};
    }
  }
  return fail(why_no_capture + "; nor is it a candump, Vector ASC or IMU log");
}

Expected<Recordings> find_recordings(const Options& options) {
  Recordings recordings;
  recordings.lidar = {.pcap = "",
                      .calibration = options.calibration,
                      .model = options.model,
                      .source = options.source,
                      .port = options.port,
                      .points = nullptr,
                      .progress = ::isatty(STDERR_FILENO) != 0};
  recordings.can = {.log = "", .dbc = options.dbc, .speed_signal = options.speed};
  recordings.imu_protocol = options.imu;
  std::error_code ignored;
  if (std::filesystem::is_directory(options.path, ignored)) {
    const Expected<Settings> drive = load_drive(options.path);
    if (!drive) return tl::unexpected(drive.error());
    take_drive(*drive, recordings);
    return recordings;
  }
  const Expected<CaptureFile> capture = CaptureFile::open(options.path);
  if (capture && capture->link() == LinkLayer::socketcan) {
    recordings.can.log = options.path;
  } else if (capture) {
    recordings.lidar.pcap = options.path;
  } else if (!std::filesystem::exists(options.path, ignored)) {
    return tl::unexpected(capture.error());
  } else if (const auto taken = take_log(options.path, capture.error().message, recordings); !taken) {
    return tl::unexpected(taken.error());
  }
  return recordings;
}

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

Expected<File> open_points(const std::string& path) {
  const auto keep_open = [](std::FILE* file) { return std::fflush(file); };
  if (path.empty()) return File(nullptr, keep_open);
  if (path == "-") return File(stdout, keep_open);
  File file(std::fopen(path.c_str(), "w"), std::fclose);
  if (!file) return fail(path + ": cannot be written; choose another --points");
  return file;
}

Expected<void> write_picture(const std::string& path, const LidarInspection& lidar) {
  if (lidar.picture.empty()) return fail(path + ": there is no sweep to draw: " + lidar.not_decoded);
  std::ofstream file(path);
  file << svg_of_sweep(lidar.picture, lidar.model + ", first complete revolution");
  file.close();
  if (!file) return fail(path + ": cannot be written; choose another --svg");
  return {};
}

Expected<Report> inspect(const Options& options) {
  Expected<Recordings> recordings = find_recordings(options);
  if (!recordings) return tl::unexpected(recordings.error());
  Report report;
  if (!recordings->lidar.pcap.empty()) {
    Expected<File> points = open_points(options.points);
    if (!points) return tl::unexpected(points.error());
    recordings->lidar.points = points->get();
    Expected<LidarInspection> lidar = inspect_lidar(recordings->lidar);
    if (!lidar) return tl::unexpected(lidar.error());
    if (*points && (std::fflush(points->get()) != 0 || std::ferror(points->get()) != 0)) {
      return fail(options.points + ": could not be written to its end; is the disk full?");
    }
    if (!options.svg.empty()) {
      if (const auto drawn = write_picture(options.svg, *lidar); !drawn) return tl::unexpected(drawn.error());
    }
    report.lidar = std::move(*lidar);
  }
  if (!recordings->can.log.empty()) {
    Expected<CanInspection> can = inspect_can(recordings->can);
    if (!can) return tl::unexpected(can.error());
    report.can = std::move(*can);
  }
  if (!recordings->imu.empty()) {
    Expected<ImuInspection> imu = inspect_imu(recordings->imu, recordings->imu_protocol);
    if (!imu) return tl::unexpected(imu.error());
    report.imu = std::move(*imu);
  }
  return report;
}

/// What a person must know beyond the figures.
std::vector<std::string> warnings_of(const Report& report) {
  std::vector<std::string> warnings;
  if (report.lidar) warnings = report.lidar->warnings;
  if (report.can) warnings.insert(warnings.end(), report.can->warnings.begin(), report.can->warnings.end());
  const auto check_together = [&](const char* name, const StreamStats& other) {
    if (!report.lidar || other.count() == 0 || report.lidar->stream.count() == 0) return;
    const StreamStats& lidar = report.lidar->stream;
    if (other.first() > lidar.last() || lidar.first() > other.last()) {
      warnings.push_back(std::string(name) + " and LiDAR were not recorded at the same time, or by different clocks");
    }
  };
  if (report.can) check_together("CAN", report.can->stream);
  if (report.imu) check_together("IMU", report.imu->stream);
  return warnings;
}

/// A recording's name in a table: the drive's folder, or the capture's file.
std::string short_name(std::filesystem::path path) {
  path = path.lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  return path.stem().string();
}

/// The LiDAR figures of PATH and of what is set beside it. A drive knows its model and calibration; those of the
/// command line are for the captures.
Expected<std::vector<LidarStatistics>> compare(const Options& options) {
  std::vector<LidarStatistics> recordings;
  std::vector<std::filesystem::path> paths{options.path};
  paths.insert(paths.end(), options.beside.begin(), options.beside.end());
  for (const std::filesystem::path& path : paths) {
    Options one = options;
    one.path = path;
    if (!options.beside.empty() && std::filesystem::is_directory(path)) one.model = one.calibration = "";
    Expected<Recordings> found = find_recordings(one);
    if (!found) return tl::unexpected(found.error());
    if (found->lidar.pcap.empty()) return fail(path.string() + ": has no LiDAR to take statistics of");
    found->lidar.statistics = true;
    Expected<LidarInspection> lidar = inspect_lidar(found->lidar);
    if (!lidar) return tl::unexpected(lidar.error());
    if (!lidar->statistics) return fail(path.string() + ": " + lidar->not_decoded);
    recordings.push_back(std::move(*lidar->statistics));
    recordings.back().path = short_name(path);
  }
  return recordings;
}

int print_statistics(const Options& options) {
  const Expected<std::vector<LidarStatistics>> recordings = compare(options);
  if (!recordings) {
    std::fprintf(stderr, "roadvec-inspect: %s\n", recordings.error().message.c_str());
    return kBadInput;
  }
  nlohmann::ordered_json json;
  for (const LidarStatistics& recording : *recordings) json["recordings"].push_back(json_of(recording));
  std::printf("%s", options.json ? (json.dump(1) + "\n").c_str() : statistics_markdown(*recordings).c_str());
  return 0;
}

void print(const Report& report, bool as_json, std::FILE* out) {
  const std::vector<std::string> warnings = warnings_of(report);
  if (as_json) {
    nlohmann::ordered_json json;
    if (report.lidar) json["lidar"] = json_of(*report.lidar);
    if (report.can) json["can"] = json_of(*report.can);
    if (report.imu) json["imu"] = json_of(*report.imu);
    json["warnings"] = warnings;
    // Names in a DBC file may be in any encoding.
    const auto replace = nlohmann::ordered_json::error_handler_t::replace;
    std::fprintf(out, "%s\n", json.dump(1, ' ', false, replace).c_str());
  } else {
    if (report.lidar) print_text(*report.lidar, out);
    if (report.can) print_text(*report.can, out);
    if (report.imu) print_text(*report.imu, out);
  }
  for (const std::string& warning : warnings) std::fprintf(stderr, "roadvec-inspect: %s\n", warning.c_str());
}

constexpr const char* kDescription =
    "Says what sensors are in a recording, and how they are: for a new car, before it is configured.\n\n"
    "PATH is a drive (a folder with drive.toml), a capture of LiDAR or CAN (pcap, pcapng; also gzip or zstd), a CAN "
    "log\n"
    "(candump, Vector ASC), or an IMU's recording (imu.log, or its bytes in a .bin). What each is, is found out.";

constexpr const char* kFooter = R"(
REPORT
  LiDAR  who sends what to which port; the model the packets are built and paced
         as, and the one they claim (old firmware lies); return mode; rate,
         jitter, pauses, losses; revolutions; the sensor's clock, its GPS and
         whether its stamps are UTC; every counter of the daemon.
  CAN    every id with its rate, jitter and pauses. With --dbc also the names,
         and which signals move with the speed: those whose correlation with
         --speed is beyond 0.95 either way. Messages of the DBC that never come.
  IMU    protocol, rate, jitter, losses, damage; what the samples hold; the mean
         acceleration, which is 9.81 m/s2 for a car at rest.
  Warnings go to stderr, one per line, and into the JSON.

POINTS
  --points writes one line per echo, in firing order, under the header
    sweep,x_m,y_m,z_m,intensity,t_ns,laser,return
  in the lidar frame: x ahead, y left, z up. t_ns is the echo's own time in
  nanoseconds since 1970 by the clock that stamped the capture; laser counts as
  in the packet; return is 0 single, 1 strongest, 2 last, 3 both in one (dual
  return). With --points - the report goes to stderr.

PICTURE
  --svg draws the first complete revolution from above, 40 m around the sensor,
  coloured by height: flat rings on the road and straight walls say that model
  and calibration are right.

STATISTICS
  --statistics tells what the LiDAR gives instead: points, firings without a
  return and range noise of each laser, ranges, intensities, returns in mid-air
  at edges, packet timing. As Markdown tables with a column for PATH and for
  each --beside, so that a simulated drive can be held against a real one.
  Beside others, --model and --calibration are for captures; drives know theirs.
  Noise and offsets are of the road 4 to 20 m ahead, 2.5 m to either side.

EXIT STATUS
  0  read to its end (a cut-off end is a warning)
  1  the input cannot be read, or not to its end    2  bad usage

EXAMPLES
  roadvec-inspect drives/town
  roadvec-inspect garage.pcap.zst --svg sweep.svg
  roadvec-inspect car.pcap --model "HDL-64E S2" --calibration db.xml --json
  roadvec-inspect can.log --dbc car.dbc --speed WheelSpeeds.FrontLeft
  roadvec-inspect imu.log --imu ncom
  roadvec-inspect /tmp/street --statistics --beside drives/town
)";

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) {
  using namespace roadvec;
  Options options;
  CLI::App app(kDescription, "roadvec-inspect");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec-inspect " ROADVEC_VERSION);
  app.add_option("PATH", options.path, "drive, capture, CAN log or IMU recording")->required();
  app.add_option("--model", options.model, "the LiDAR's model; default: what the drive says, or what it looks like");
  app.add_option("--calibration", options.calibration,
                 "the head's db.xml or ROS YAML, or \"streamed\" for an HDL-64E's own; default: the drive's, or the "
                 "model's own angles")
      ->type_name("FILE");
  app.add_option("--port", options.port, "UDP port of the data packets; 0: any")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  app.add_option("--source", options.source, "IPv4 address of the sensor, if several send; default: the busiest");
  app.add_option("--points", options.points, "file for the decoded points; - is stdout")->type_name("FILE");
  app.add_option("--svg", options.svg, "file for a picture of one revolution")->type_name("FILE");
  app.add_option("--dbc", options.dbc, "names the CAN signals; default: the drive's")->type_name("FILE");
  app.add_option("--speed", options.speed,
                 "\"Message.Signal\" that the other signals are compared with; default: the drive's first wheel speed");
  app.add_option("--imu", options.imu, "what the IMU speaks; default: the drive's, or what is understood best")
      ->check(CLI::IsMember({"xsens", "ncom"}));
  app.add_flag("--statistics", options.statistics, "what the LiDAR gives, laser by laser, in place of the report");
  app.add_option("--beside", options.beside, "another drive or capture for --statistics; may be given again")
      ->type_name("PATH");
  app.add_flag("--json", options.json, "report as one JSON object");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadUsage;
  }
  if (options.statistics) return print_statistics(options);
  const Expected<Report> report = inspect(options);
  if (!report) {
    std::fprintf(stderr, "roadvec-inspect: %s\n", report.error().message.c_str());
    return kBadInput;
  }
  print(*report, options.json, options.points == "-" ? stderr : stdout);
  if (report->lidar && !report->lidar->damage.empty()) {
    std::fprintf(stderr, "roadvec-inspect: %s\n", report->lidar->damage.c_str());
    return kBadInput;
  }
  return 0;
}
