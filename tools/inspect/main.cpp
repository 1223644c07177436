#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "daemon/config/load.h"
#include "tools/inspect/inspection.h"

namespace roadvec {
namespace {

constexpr int kBadInput = 1, kBadUsage = 2;

struct Options {
  std::filesystem::path path, calibration;
  std::string model, points;
  bool json = false;
  int port = kDataPort;
};

/// A recording and whose it is.
struct Recording {
  std::filesystem::path pcap, calibration;
  LidarModel model{};
  Survey survey;
};

/// The first packets, before anything is decided about them.
Expected<Survey> look_at(const std::filesystem::path& pcap, int port) {
  constexpr std::size_t kEnough = 256;
  LidarCounters counters;
  auto reader = PcapReader::open(pcap, {.port = port}, counters);
  if (!reader) return tl::unexpected(reader.error());
  std::vector<RawPacket> packets;
  std::span<const RawPacket> batch;
  while (packets.size() < kEnough && (*reader)->read(batch, {}) == ReadResult::packets) {
    packets.insert(packets.end(), batch.begin(), batch.end());
  }
  if (packets.empty()) {
    return fail(pcap.string() + ": no data packets to UDP port " + std::to_string(port) + " (" +
                std::to_string((*reader)->position_packet_count()) + " position packets, " +
                std::to_string((*reader)->other_frame_count()) + " other frames, " +
                std::to_string(counters.wrong_length.value()) + " of wrong length); try --port 0 for any port");
  }
  return survey(packets);
}

Expected<Recording> find_recording(const Options& options) {
  Recording recording;
  recording.pcap = options.path;
  recording.calibration = options.calibration;
  std::string model = options.model;
  std::error_code ignored;
  if (std::filesystem::is_directory(options.path, ignored)) {
    const Expected<Settings> drive = load_drive(options.path);
    if (!drive) return tl::unexpected(drive.error());
    recording.pcap = drive->lidar.pcap;
    if (recording.calibration.empty()) recording.calibration = drive->lidar.calibration;
    if (model.empty()) model = drive->lidar.model;
  }
  const Expected<Survey> seen = look_at(recording.pcap, options.port);
  if (!seen) return tl::unexpected(seen.error());
  recording.survey = *seen;
  const std::optional<LidarModel> likely = likely_model(recording.survey);
  const std::string hint =
      likely ? "they look like those of a " + std::string(name_of(*likely)) : "they fit no model known here";
  if (model.empty()) {
    return fail(recording.pcap.string() + ": whose packets are these? " + hint + "; say --model \"" +
                std::string(likely ? name_of(*likely) : "NAME") + "\"");
  }
  const Expected<LidarModel> named = lidar_model_from(model);
  if (!named) return tl::unexpected(named.error());
  if (const std::string reason = misfit(recording.survey, *named); !reason.empty()) {
    return fail(recording.pcap.string() + ": not the packets of a " + model + ": " + reason + "; " + hint);
  }
  recording.model = *named;
  return recording;
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

Expected<Inspection> run(const Options& options) {
  const Expected<Recording> recording = find_recording(options);
  if (!recording) return tl::unexpected(recording.error());
  const Expected<Calibration> calibration = calibration_for(recording->model, recording->calibration);
  if (!calibration) return tl::unexpected(calibration.error());
  LidarCounters counters;
  auto reader = PcapReader::open(recording->pcap, {.port = options.port}, counters);
  if (!reader) return tl::unexpected(reader.error());
  Expected<File> points = open_points(options.points);
  if (!points) return tl::unexpected(points.error());
  const bool progress = ::isatty(STDERR_FILENO) != 0;
  Inspection result = inspect(**reader, recording->pcap.string(), recording->survey, recording->model, *calibration,
                              counters, points->get(), progress);
  if (*points && (std::fflush(points->get()) != 0 || std::ferror(points->get()) != 0)) {
    return fail(options.points + ": could not be written to its end; is the disk full?");
  }
  return result;
}

constexpr const char* kDescription =
    "Says what is in a LiDAR recording: model, rates, losses, revolutions, clocks; writes the decoded points.\n\n"
    "PATH is a drive (a folder with drive.toml) or a capture (pcap, pcapng). A capture alone does not say whose it is: "
    "name the\n"
    "model with --model, and for an HDL-64E its db.xml with --calibration.";

constexpr const char* kFooter =
    "POINTS\n"
    "  --points writes one line per echo, in firing order, under the header\n"
    "    sweep,x_m,y_m,z_m,intensity,t_ns,laser,return\n"
    "  in the lidar frame: x ahead, y left, z up. t_ns is the echo's own time in nanoseconds since 1970 by the clock "
    "that stamped\n"
    "  the capture; laser counts as in the packet; return is 0 single, 1 strongest, 2 last, 3 both in one (dual "
    "return).\n"
    "  With --points - the report goes to stderr.\n\n"
    "EXIT STATUS\n"
    "  0  read to its end    1  the input cannot be read, or not to its end    2  bad usage\n\n"
    "EXAMPLES\n"
    "  roadvec-inspect drives/town\n"
    "  roadvec-inspect garage.pcap --model VLP-16 --points garage.csv\n"
    "  roadvec-inspect car.pcap --model \"HDL-64E S2\" --calibration db.xml --json\n";

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) {
  using namespace roadvec;
  Options options;
  CLI::App app(kDescription, "roadvec-inspect");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec-inspect " ROADVEC_VERSION);
  app.add_option("PATH", options.path, "drive or capture")->required();
  app.add_option("--model", options.model,
                 "\"HDL-64E S2\", \"HDL-64E S3\", \"HDL-32E\", \"VLP-16\", \"Puck Hi-Res\", \"VLP-32C\" or "
                 "\"VLS-128\"; default: what the drive says");
  app.add_option("--calibration", options.calibration,
                 "the head's db.xml or ROS YAML, or \"streamed\" for an HDL-64E's own; default: the drive's, or the "
                 "model's angles");
  app.add_option("--points", options.points, "file for the decoded points; - is stdout")->type_name("FILE");
  app.add_flag("--json", options.json, "report as one JSON object");
  app.add_option("--port", options.port, "UDP port of the data packets; 0: any")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadUsage;
  }
  const Expected<Inspection> inspection = run(options);
  if (!inspection) {
    std::fprintf(stderr, "roadvec-inspect: %s\n", inspection.error().message.c_str());
    return kBadInput;
  }
  std::FILE* const out = options.points == "-" ? stderr : stdout;
  options.json ? print_json(*inspection, out) : print_text(*inspection, out);
  if (!inspection->damage.empty()) {
    std::fprintf(stderr, "roadvec-inspect: %s\n", inspection->damage.c_str());
    return kBadInput;
  }
  return 0;
}
