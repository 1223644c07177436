#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "tools/import/report_text.h"

namespace roadvec {
namespace {

constexpr int kDone = 0, kFailed = 1, kWrongUse = 2;

constexpr const char* kDescription =
    "roadvec-import - turns public data sets into drives\n\n"
    "Makes a drive folder for roadvecd --drive, roadvec-replay, roadvec-inspect and roadvec-score from a recording in\n"
    "another form.";

constexpr const char* kKittiDescription =
    "a drive of KITTI's raw data, \"synced\" kind\n\n"
    "Turns the points of the scans back into what the HDL-64E measured, by a calibration found from the points alone,\n"
    "and writes its packets; turns the OXTS rows into the messages of the car's bus and of an IMU; registers the "
    "scans\n"
    "and writes the path as truth. Then decodes the packets and says how far the points lie from KITTI's. Damaged "
    "scans\n"
    "are named and left out.";

constexpr const char* kKittiFooter =
    "WHAT IT READS\n"
    "  DIR/velodyne_points/{timestamps_start.txt,timestamps_end.txt,data/*.bin}\n"
    "  DIR/oxts/{timestamps.txt,data/*.txt}     DIR/../calib_imu_to_velo.txt\n\n"
    "FILES IN OUT\n"
    "  drive.toml               sensors, mounting, anchor\n"
    "  lidar.pcap, db.xml       HDL-64E S2 packets (nanosecond pcap) and the calibration\n"
    "  can.log, vehicle.dbc     steering and wheel speeds, from the OXTS speed and yaw rate by a car that does not "
    "slip\n"
    "  imu.log                  Xsens MTData2 messages: OXTS rates, accelerations and attitude\n"
    "  truth/poses.tum          path of the rear axle in the map frame: centimetres between sweeps, the OXTS' own "
    "error\n"
    "                           in place and heading of the whole";

constexpr const char* kFooter =
    "EXIT STATUS\n"
    "  0 done   1 the recording cannot be used or a file cannot be written   2 wrong use of the command\n"
    "  With points farther from the recording's than 1 mm (median) or 2 mm (95 %) it warns, and ends with 0.\n\n"
    "EXAMPLES\n"
    "  roadvec-import kitti-raw 2011_09_26/2011_09_26_drive_0005_sync /tmp/kitti_0005\n"
    "  roadvecd --drive /tmp/kitti_0005 --out /tmp/map && roadvec-score /tmp/kitti_0005 /tmp/map";

struct Arguments {
  std::string folder, out;
  bool json = false;
};

void show_progress(std::string_view step, double share) {
  std::fprintf(stderr, "\r%-24.*s %3.0f %%%s", static_cast<int>(step.size()), step.data(), 100 * share,
               share < 1 ? "" : "\n");
}

int import_kitti(const Arguments& arguments) {
  ImportProgress progress = [](std::string_view, double) {};
  if (isatty(STDERR_FILENO) != 0) progress = show_progress;
  const auto report = import_kitti_raw(arguments.folder, arguments.out, progress);
  if (!report) {
    std::fprintf(stderr, "roadvec-import: %s\n", report.error().message.c_str());
    return kFailed;
  }
  std::fputs((arguments.json ? json_of : text_of)(*report, arguments.out).c_str(), stdout);
  if (!report->faithful()) {
    std::fprintf(stderr, "roadvec-import: warning: the packets do not give the points back as they should\n");
  }
  return kDone;
}

int parse_and_run(int argc, char** argv) {
  CLI::App app(kDescription, "roadvec-import");
  app.footer(kFooter);
  app.set_version_flag("--version", "roadvec-import " ROADVEC_VERSION);
  app.require_subcommand(1);
  Arguments arguments;
  CLI::App* kitti = app.add_subcommand("kitti-raw", kKittiDescription);
  kitti->footer(std::string(kKittiFooter) + "\n\n" + kFooter);
  kitti->add_option("DIR", arguments.folder, "the drive, like 2011_09_26/2011_09_26_drive_0005_sync")->required();
  kitti->add_option("OUT", arguments.out, "the drive folder to make; must not exist, or be empty")->required();
  kitti->add_flag("--json", arguments.json, "report as one JSON object on standard output");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kWrongUse;
  }
  return import_kitti(arguments);
}

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) {
  try {
    return roadvec::parse_and_run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "roadvec-import: %s\n", error.what());
    return roadvec::kFailed;
  }
}
