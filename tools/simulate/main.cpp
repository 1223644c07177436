#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "drivers/velodyne/model.h"
#include "tools/recording/output_file.h"
#include "tools/simulate/city.h"
#include "tools/simulate/picture.h"
#include "tools/simulate/scene_file.h"
#include "tools/simulate/simulate.h"

namespace roadvec {
namespace {

constexpr int kDone = 0, kFailed = 1, kWrongUse = 2;

constexpr const char* kDescription =
    "roadvec-simulate - makes a drive with known truth\n\n"
    "Builds a made-up street, drives a car through it and writes what its sensors would have recorded: a drive folder\n"
    "for roadvecd --drive, roadvec-replay and roadvec-inspect, with the true path and the true boundaries beside it.\n"
    "LiDAR beams are cast one by one from where the head is when each laser fires. The same scene and seed give the\n"
    "same bytes.";

constexpr const char* kFooter =
    "FILES IN OUT\n"
    "  drive.toml               sensors, mounting, anchor\n"
    "  lidar.pcap, db.xml       LiDAR packets as captured (nanosecond pcap); calibration, for models that need one\n"
    "  can.log, vehicle.dbc     steering and wheel speeds as candump -L writes them; what they mean\n"
    "  imu.log                  Xsens MTData2 messages\n"
    "  truth/poses.tum          the true path in the map frame, 100 poses a second\n"
    "  truth/sweeps.tum         the same at the end of each revolution\n"
    "  truth/boundaries.geojson the true kerbs, walls and parked cars, WGS 84; `seen_within_m`: from how near\n\n"
    "EXIT STATUS\n"
    "  0 done   1 the scene is wrong or a file cannot be written   2 wrong use of the command\n\n"
    "EXAMPLES\n"
    "  roadvec-simulate --list\n"
    "  roadvec-simulate street /tmp/street\n"
    "  roadvec-simulate street --picture street.svg\n"
    "  roadvec-simulate city /tmp/city --length-km 20 --seed 3\n"
    "  roadvec-simulate my_scene.toml /tmp/mine --seed 7 --lidar VLP-16 --duration 10\n\n"
    "Every key of a scene file is explained in tools/simulate/README.md and in the scenes shipped there.";

struct Arguments {
  std::string scene, out, lidar, picture;
  std::uint64_t seed = 1;
  double duration_s = 0, length_km = 2;
  bool list = false, json = false, print_scene = false, coarse_can = false;
};

/// As a JSON string, quotes included.
std::string quoted(const std::string& text) {
  std::string json = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') json += '\\';
    json += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return json + "\"";
}

int failed(const Error& error) {
  std::fprintf(stderr, "roadvec-simulate: %s\n", error.message.c_str());
  return kFailed;
}

int list_scenes(bool json) {
  std::string text;
  for (const ShippedScene& shipped : shipped_scenes()) {
    const auto scene = parse_scene(shipped.text, std::string(shipped.name));
    if (!scene) return failed(scene.error());
    const std::string name(shipped.name);
    if (json) {
      text +=
          (text.empty() ? "" : ",") + ("{\"name\":\"" + name + "\",\"description\":\"" + scene->description + "\"}");
    } else {
      text += name + std::string(name.size() < 10 ? 10 - name.size() : 1, ' ') + scene->description + "\n";
    }
  }
  std::printf(json ? "[%s]\n" : "%s", text.c_str());
  return kDone;
}

void show_progress(double done_s, double whole_s) {
  std::fprintf(stderr, "\rsimulating %5.1f of %.1f s%s", done_s, whole_s, done_s < whole_s ? "" : "\n");
}

void print_report(const SimulateReport& report, const std::string& out, bool json) {
  const char* const format =
      json ? "{\"out\":%s,\"lidar\":\"%s\",\"duration_s\":%.3f,\"distance_m\":%.3f,\"packets\":%llu,\"lost_"
             "packets\":%llu,"
             "\"returns\":%llu,\"lidar_bytes\":%llu,\"can_frames\":%llu,\"imu_samples\":%llu,\"boundaries\":%llu}\n"
           : "%s: %s, %.1f s, %.1f m driven, %llu packets (%llu lost), %llu returns, %llu bytes, %llu CAN frames, "
             "%llu IMU samples, %llu boundaries\n";
  const auto n = [](std::uint64_t count) { return static_cast<unsigned long long>(count); };
  std::printf(format, (json ? quoted(out) : out).c_str(), report.model.c_str(), report.duration_s, report.distance_m,
              n(report.packet_count), n(report.lost_packet_count), n(report.return_count), n(report.lidar_bytes),
              n(report.can_frame_count), n(report.imu_sample_count), n(report.boundary_count));
}

/// The text of a shipped scene, of a random town, or of a file.
Expected<std::string> scene_text(const Arguments& arguments) {
  return arguments.scene == "city" ? city_scene(arguments.seed, arguments.length_km) : load_scene_text(arguments.scene);
}

Expected<void> write_picture(const Scene& scene, const std::string& path) {
  const auto picture = picture_of(scene);
  if (!picture) return tl::unexpected(picture.error());
  auto file = OutputFile::create(path);
  if (!file) return tl::unexpected(file.error());
  file->write(*picture);
  return file->close();
}

int run(const Arguments& arguments, bool has_duration) {
  const auto text = scene_text(arguments);
  if (!text) return failed(text.error());
  if (arguments.print_scene) {
    std::fputs(text->c_str(), stdout);
    return kDone;
  }
  auto scene = parse_scene(*text, arguments.scene);
  if (!scene) return failed(scene.error());
  if (arguments.coarse_can) scene->errors.steering_step_deg = scene->errors.wheel_speed_step_kmph = 1;
  if (!arguments.picture.empty()) {
    const auto written = write_picture(*scene, arguments.picture);
    return written ? kDone : failed(written.error());
  }
  SimulateOptions options;
  options.seed = arguments.seed;
  if (!arguments.lidar.empty()) options.maybe_model = arguments.lidar;
  if (has_duration) options.maybe_duration_s = arguments.duration_s;
  if (isatty(STDERR_FILENO) != 0) options.progress = show_progress;
  const auto report = simulate(*scene, arguments.scene, arguments.out, options);
  if (!report) return failed(report.error());
  print_report(*report, arguments.out, arguments.json);
  return kDone;
}

int parse_and_run(int argc, char** argv) {
  CLI::App app(kDescription, "roadvec-simulate");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec-simulate " ROADVEC_VERSION);
  Arguments arguments;
  app.add_option("SCENE", arguments.scene, "a shipped scene's name, `city` (a random town), or a scene file (TOML)");
  app.add_option("OUT", arguments.out, "the drive folder to make; must not exist, or be empty");
  app.add_option("--seed", arguments.seed, "of all sensor noise, and of the city (default 1)");
  app.add_option("--lidar", arguments.lidar, "model in place of the scene's: HDL-64E S2, HDL-32E, VLP-16");
  const CLI::Option* duration =
      app.add_option("--duration", arguments.duration_s, "seconds after which the drive ends at the latest")
          ->check(CLI::Range(0.1, 1e5));
  app.add_flag("--coarse-can", arguments.coarse_can,
               "CAN in steps of 1 degree and 1 km/h, as on the car of He et al. 2018, in place of the scene's");
  app.add_option("--length-km", arguments.length_km, "driven in the city (default 2)")->check(CLI::Range(0.3, 200.0));
  app.add_option("--picture", arguments.picture, "draw the scene from above into this SVG file, and exit");
  app.add_flag("--print-scene", arguments.print_scene, "print the scene file, and exit");
  app.add_flag("--list", arguments.list, "name the shipped scenes, and exit");
  app.add_flag("--json", arguments.json, "report as one JSON object on standard output");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongUse;
  }
  if (arguments.list) return list_scenes(arguments.json);
  if (!arguments.lidar.empty()) {
    if (const auto model = lidar_model_from(arguments.lidar); !model) {
      std::fprintf(stderr, "roadvec-simulate: --lidar: %s\n", model.error().message.c_str());
      return kWrongUse;
    }
  }
  const bool drives = arguments.picture.empty() && !arguments.print_scene;
  if (arguments.scene.empty() || (drives && arguments.out.empty())) {
    std::fprintf(stderr, "roadvec-simulate: SCENE and OUT are needed; --list names the scenes, --help explains\n");
    return kWrongUse;
  }
  return run(arguments, duration->count() > 0);
}

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) {
  try {
    return roadvec::parse_and_run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "roadvec-simulate: %s\n", error.what());
    return roadvec::kFailed;
  }
}
