#include "tools/simulate/simulate.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/angle.h"
#include "tools/recording/db_xml_writer.h"
#include "tools/recording/drive_folder.h"
#include "tools/recording/pcap_writer.h"
#include "tools/simulate/lidar_scanner.h"
#include "tools/simulate/truth_files.h"
#include "tools/simulate/vehicle_logs.h"

namespace roadvec {
namespace {

namespace fs = std::filesystem;

/// Noise streams of a seed, one for each sensor.
enum Stream : std::uint64_t { kLidarStream = 1, kLossStream = 2, kImuStream = 3, kCanStream = 4 };

/// A car off the road or in another car is a mistake in the scene.
Expected<void> check_clear_way(const Scene& scene, const World& world, const CarMotion& motion) {
  constexpr double kOverRoof_m = 1.6;
  const double side_m = scene.car.track_m / 2, front_m = scene.car.wheelbase_m;
  const std::array<Eigen::Vector2d, 5> places_m{
      {{0, side_m}, {0, -side_m}, {front_m, side_m}, {front_m, -side_m}, {scene.lidar.x_m, scene.lidar.y_m}}};
  for (double time_s = 0; time_s < motion.duration_s(); time_s += 0.1) {
    for (const Eigen::Vector2d& place_m : places_m) {
      const Eigen::Vector2d point_m = motion.at(time_s).pose * place_m;
      if (!world.scenery(time_s).on_road(point_m)) {
        return fail(
            print("the car leaves the road %.1f s into the drive, at x %.1f, y %.1f; change car.lane_m or widen "
                  "the road or its corner",
                  time_s, point_m.x(), point_m.y()));
      }
      const Hit below = world.cast({point_m.x(), point_m.y(), world.height_at(point_m, time_s) + kOverRoof_m},
                                   {0, 0, -1}, kOverRoof_m + 1, time_s);
      if (below.face == Hit::kGround) continue;
      return fail(
          print("the car runs into something %.1f s into the drive, at x %.1f, y %.1f; change car.lane_m, the "
                "parked cars or the movers",
                time_s, point_m.x(), point_m.y()));
    }
  }
  return {};
}

DriveDescription description(const Scene& scene, const std::string& name, const LidarHead& head,
                             const SimulateOptions& options, const Pose2& start) {
  DriveDescription drive;
  drive.source = print("roadvec-simulate, scene %s, seed %llu: made up, free for any use",
                       fs::path(name).filename().c_str(), static_cast<unsigned long long>(options.seed));
  drive.lidar_model = scene.lidar.model;
  drive.has_calibration = facts_of(head.model).needs_calibration();
  drive.lidar_x_m = scene.lidar.x_m;
  drive.lidar_y_m = scene.lidar.y_m;
  drive.lidar_z_m = scene.lidar.z_m;
  drive.lidar = {scene.lidar.roll_deg, scene.lidar.pitch_deg, scene.lidar.yaw_deg};
  drive.wheelbase_m = scene.car.wheelbase_m;
  drive.track_m = scene.car.track_m;
  drive.steering_ratio = scene.car.steering_ratio;
  drive.anchor = {scene.anchor.latitude_deg, scene.anchor.longitude_deg, scene.anchor.height_m,
                  deg_from_rad(start.theta_rad)};
  return drive;
}

double distance_m(const CarMotion& motion, double duration_s) {
  double sum_m = 0;
  for (double time_s = 0; time_s < duration_s; time_s += 0.01) {
    sum_m += (motion.at(std::min(time_s + 0.01, duration_s)).pose.translation() - motion.at(time_s).pose.translation())
                 .norm();
  }
  return sum_m;
}

/// The network between head and recorder: loses packets, swaps neighbours, delays each a little; arrivals never go
/// back.
class Network {
 public:
  Network(const ErrorSpec& errors, Random random, PcapWriter& pcap) : errors_(errors), random_(random), pcap_(pcap) {}

  /// False: the packet is lost.
  bool carry(const SimulatedPacket& packet) {
    if (random_.uniform() < errors_.packet_loss) return false;
    if (!maybe_late_ && random_.uniform() < errors_.packet_reordering) {
      maybe_late_ = packet;
      return true;
    }
    deliver(packet, packet.end);
    if (maybe_late_) deliver(*maybe_late_, packet.end);
    maybe_late_.reset();
    return true;
  }
  void finish() {
    if (maybe_late_) deliver(*maybe_late_, maybe_late_->end);
    maybe_late_.reset();
  }

 private:
  void deliver(const SimulatedPacket& packet, SensorTime sent) {
    const double delay_us = std::abs(errors_.arrival_jitter_us * random_.normal());
    last_.ns = std::max<std::int64_t>(last_.ns + 1000, sent.ns + std::llround(1000 * delay_us));
    pcap_.write(packet.bytes, last_);
  }

  const ErrorSpec& errors_;
  Random random_;
  PcapWriter& pcap_;
  std::optional<SimulatedPacket> maybe_late_;
  SensorTime last_;
};

Expected<void> write_lidar(const Scene& scene, const SimulateOptions& options, const fs::path& out,
                           LidarScanner& scanner, SimulateReport& report) {
  auto file = OutputFile::create(out / "lidar.pcap");
  if (!file) return tl::unexpected(file.error());
  PcapWriter pcap(std::move(*file));
  Network network(scene.errors, Random(options.seed, kLossStream), pcap);
  constexpr double kReportEvery_s = 0.5;
  double next_report_s = 0;
  while (scanner.time_s() < report.duration_s) {
    if (scanner.time_s() >= next_report_s) {
      options.progress(scanner.time_s(), report.duration_s);
      next_report_s += kReportEvery_s;
    }
    const bool carried = network.carry(scanner.next());
    ++(carried ? report.packet_count : report.lost_packet_count);
  }
  network.finish();
  options.progress(report.duration_s, report.duration_s);
  report.return_count = scanner.return_count();
  report.lidar_bytes = pcap.size_bytes();
  return pcap.close();
}

}  // namespace

Expected<SimulateReport> simulate(Scene scene, const std::string& scene_name, const fs::path& out,
                                  const SimulateOptions& options) {
  if (options.maybe_model) scene.lidar.model = *options.maybe_model;
  const auto head = make_lidar_head(scene.lidar.model);
  if (!head) return tl::unexpected(head.error());
  if (scene.lidar.return_mode == ReturnMode::dual && facts_of(head->model).dual == DualLayout::none) {
    return fail(scene_name + ": lidar.return_mode: a " + scene.lidar.model +
                " sends one return of a firing; use strongest or last");
  }
  const auto path = route_of(scene);
  if (!path) return fail(scene_name + ": " + path.error().message);
  const auto built = build_world(scene);
  if (!built) return fail(scene_name + ": " + built.error().message);
  const auto motion =
      drive(scene.car, *path, [&](const Eigen::Vector2d& point_m) { return built->world.height_at(point_m); });
  if (!motion) return fail(scene_name + ": " + motion.error().message);
  if (auto clear = check_clear_way(scene, built->world, *motion); !clear)
    return fail(scene_name + ": " + clear.error().message);
  if (auto made = make_drive_folder(out); !made) return tl::unexpected(made.error());

  SimulateReport report;
  report.model = scene.lidar.model;
  report.duration_s = std::min(motion->duration_s(), options.maybe_duration_s.value_or(motion->duration_s()));
  report.distance_m = distance_m(*motion, report.duration_s);
  const Pose2 start = motion->at(0).pose;
  LidarScanner scanner(scene, *head, built->world, *motion, Random(options.seed, kLidarStream));
  return write_lidar(scene, options, out, scanner, report)
      .and_then([&] {
        return write_file(out / "drive.toml", [&](OutputFile& file) {
          file.write(drive_toml(description(scene, scene_name, *head, options, start)));
        });
      })
      .and_then([&]() -> Expected<void> {
        if (!facts_of(head->model).needs_calibration()) return {};
        return write_file(out / "db.xml", [&](OutputFile& file) { file.write(db_xml(head->calibration)); });
      })
      .and_then(
          [&] { return write_file(out / "vehicle.dbc", [&](OutputFile& file) { file.write(vehicle_dbc(scene)); }); })
      .and_then([&] {
        return write_file(out / "can.log", [&](OutputFile& file) {
          report.can_frame_count =
              write_can_log(scene, *motion, report.duration_s, Random(options.seed, kCanStream), file);
        });
      })
      .and_then([&] {
        return write_file(out / "imu.log", [&](OutputFile& file) {
          report.imu_sample_count =
              write_imu_log(scene, *motion, report.duration_s, Random(options.seed, kImuStream), file);
        });
      })
      .and_then([&] {
        return write_file(out / "truth/poses.tum",
                          [&](OutputFile& file) { write_poses_tum(scene, *motion, report.duration_s, file); });
      })
      .and_then([&] {
        return write_file(out / "truth/sweeps.tum",
                          [&](OutputFile& file) { write_sweeps_tum(scene, *motion, report.duration_s, file); });
      })
      .and_then([&] {
        return write_file(out / "truth/boundaries.geojson", [&](OutputFile& file) {
          report.boundary_count = write_boundaries_geojson(scene, *built, start, scanner.faces_seen(), file);
        });
      })
      .map([&] { return report; });
}

}  // namespace roadvec
