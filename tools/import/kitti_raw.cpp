#include "tools/import/kitti_raw.h"

#include <algorithm>

#include "core/base/angle.h"
#include "tools/import/packet_stream.h"
#include "tools/recording/db_xml_writer.h"

namespace roadvec {
namespace {

namespace fs = std::filesystem;

/// Sweeps that the head is fitted to, spread over the drive: 24 give every laser 25,000 points or more.
constexpr std::size_t kFitFrames = 24;
/// The logs begin before the first sweep and end behind the last.
constexpr std::int64_t kAround_ns = 100'000'000;
/// A damaged scan's points lie off their lasers.
constexpr double kMostOff = 0.01;

Expected<LaserPoints> load_lasers(const KittiFrame& frame) {
  return load_scan(frame).and_then([](const std::vector<KittiPoint>& points) { return split_lasers(points); });
}

class KittiImport {
 public:
  KittiImport(KittiDrive drive, fs::path out, const ImportProgress& progress)
      : drive_(std::move(drive)), out_(std::move(out)), progress_(progress), track_(drive_.oxts) {
    report_.left_out = std::move(drive_.left_out);
  }

  Expected<ImportReport> run() {
    return fit()
        .and_then([&] { return make_drive_folder(out_); })
        .and_then([&] { return write_lidar(); })
        .and_then([&] { return check(); })
        .and_then([&] { return write_rest(); })
        .map([&] { return std::move(report_); });
  }

 private:
  Expected<void> fit() {
    std::vector<LaserPoints> revolutions;
    const std::size_t step = std::max<std::size_t>(1, drive_.frames.size() / kFitFrames);
    for (std::size_t i = 0; i < drive_.frames.size() && revolutions.size() < kFitFrames; i += step) {
      auto points = load_lasers(drive_.frames[i]);
      if (points) revolutions.push_back(*std::move(points));
      progress_("fitting the head", static_cast<double>(revolutions.size()) / (kFitFrames + 1));
    }
    if (revolutions.empty()) {
      const auto first = load_lasers(drive_.frames.front());
      return fail(drive_.frames.front().path.string() + " and every other scan looked at is damaged: " +
                  (first ? "" : first.error().message) + "; unpack the drive again");
    }
    const auto head = fit_head(revolutions);
    progress_("fitting the head", 1);
    if (!head)
      return fail("the scans of " + drive_.frames.front().path.parent_path().string() + ": " + head.error().message);
    head_ = *head;
    report_.off_the_line_m = head->off_the_line_m;
    report_.cell_error = head->cell_error;
    report_.rotation_agreement = head->rotation_agreement;
    return {};
  }

  Expected<Firings> firings_of(const KittiFrame& frame) const {
    auto points = load_lasers(frame);
    if (!points) return tl::unexpected(points.error());
    mend_borders(*points, head_);
    Firings firings = find_firings(*points, head_, frame.start, frame.end);
    std::size_t point_count = 0;
    for (const auto& laser : *points) point_count += laser.size();
    if (static_cast<double>(firings.off_count) > kMostOff * static_cast<double>(point_count)) {
      return fail(print("%zu of its %zu points lie off their lasers", firings.off_count, point_count));
    }
    return firings;
  }

  Expected<void> write_lidar() {
    const auto calibration =
        write_file(out_ / "db.xml", [&](OutputFile& file) { file.write(db_xml(calibration_of(head_))); });
    if (!calibration) return calibration;
    auto file = OutputFile::create(out_ / "lidar.pcap");
    if (!file) return tl::unexpected(file.error());
    PcapWriter pcap(std::move(*file));
    PacketStream packets(pcap);
    std::size_t done_count = 0;
    for (const KittiFrame& frame : drive_.frames) {
      const auto firings = firings_of(frame);
      if (firings) {
        for (const Firing& firing : firings->firings) packets.add(firing);
        sweeps_.push_back(thinned(*firings, frame.start, frame.end));
        used_.push_back(frame);
        report_.lost_point_count += firings->lost_count;
        report_.off_point_count += firings->off_count;
      } else {
        leave_out(report_.left_out, frame.name, firings.error().message);
      }
      progress_("writing packets", static_cast<double>(++done_count) / static_cast<double>(drive_.frames.size()));
    }
    packets.finish();
    if (used_.empty()) return fail(drive_.frames.front().path.parent_path().string() + " has no scan that is whole");
    report_.frame_count = used_.size();
    report_.packet_count = packets.packet_count();
    report_.lidar_bytes = pcap.size_bytes();
    report_.duration_s = seconds_between(used_.front().start, used_.back().end);
    return pcap.close();
  }

  Expected<void> check() {
    std::size_t next = 0;
    std::optional<Error> maybe_error;
    const auto next_revolution = [&]() -> std::vector<Firing> {
      progress_("decoding the packets", static_cast<double>(next) / static_cast<double>(used_.size()));
      if (next == used_.size()) return {};
      auto firings = firings_of(used_[next++]);
      if (firings) return std::move(firings->firings);
      maybe_error = firings.error();
      return {};
    };
    const auto round_trip = check_round_trip(out_ / "lidar.pcap", out_ / "db.xml", next_revolution);
    if (!round_trip) return tl::unexpected(round_trip.error());
    if (maybe_error) return fail("the scans changed while they were read: " + maybe_error->message);
    report_.round_trip = *round_trip;
    report_.point_count = round_trip->point_count + round_trip->missing_count;
    return {};
  }

  /// The LiDAR's motion as the OXTS box says, driven along an arc.
  [[nodiscard]] Eigen::Isometry3d oxts_motion(SensorTime from, SensorTime to) const {
    const OxtsSample sample = track_.at(from + (to - from) / 2);
    const double duration_s = seconds_between(from, to), turn_rad = sample.rate_radps.z() * duration_s;
    const Eigen::Vector3d way_m(sample.forward_mps * duration_s, sample.leftward_mps * duration_s, 0);
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    motion.translation() = Eigen::AngleAxisd(turn_rad / 2, Eigen::Vector3d::UnitZ()) * way_m;
    return drive_.T_lidar_imu * motion * drive_.T_lidar_imu.inverse();
  }

  Expected<void> write_rest() {
    const Registration registration = register_sweeps(
        sweeps_, [&](SensorTime from, SensorTime to) { return oxts_motion(from, to); },
        [&](double share) { progress_("registering the sweeps", share); });
    report_.residual_m = registration.residual_m;
    report_.matched_share = registration.matched_share;
    for (std::size_t i = 1; i < sweeps_.size(); ++i) {
      report_.distance_m +=
          (registration.T_first_lidar[i].translation() - registration.T_first_lidar[i - 1].translation()).norm();
    }
    const Eigen::Isometry3d T_vehicle_lidar = lidar_mounting(sweeps_, registration, car_);
    const Eigen::Isometry3d T_vehicle_imu = T_vehicle_lidar * drive_.T_lidar_imu;
    const TruthPath path = place_path(sweeps_, registration, track_, T_vehicle_lidar, T_vehicle_imu);
    report_.lidar = angles_of(T_vehicle_lidar.linear());
    report_.anchor = path.anchor;
    const SensorTime start = used_.front().start, end = used_.back().end;
    const SensorTime from = start - kAround_ns, to = end + kAround_ns;
    const double imu_left_m = T_vehicle_imu.translation().y();
    return write_file(out_ / "drive.toml",
                      [&](OutputFile& file) { file.write(drive_toml(description(T_vehicle_imu))); })
        .and_then(
            [&] { return write_file(out_ / "vehicle.dbc", [&](OutputFile& file) { file.write(vehicle_dbc({})); }); })
        .and_then([&] {
          return write_file(out_ / "can.log", [&](OutputFile& file) {
            report_.can_frame_count = write_can_log(track_, car_, imu_left_m, from, to, file);
          });
        })
        .and_then([&] {
          return write_file(out_ / "imu.log", [&](OutputFile& file) {
            report_.imu_sample_count = write_imu_log(track_, from, to, file);
          });
        })
        .and_then([&] {
          return write_file(out_ / "truth/poses.tum",
                            [&](OutputFile& file) { write_poses_tum(path, start, end, file); });
        });
  }

  [[nodiscard]] DriveDescription description(const Eigen::Isometry3d& T_vehicle_imu) const {
    DriveDescription drive;
    const fs::path folder = drive_.frames.front().path.parent_path().parent_path().parent_path();
    drive.source = "KITTI raw data, " + fs::absolute(folder).lexically_normal().filename().string() +
                   " (CC BY-NC-SA 3.0), by roadvec-import";
    drive.lidar_model = name_of(LidarModel::hdl64e_s2);
    drive.lidar_x_m = car_.lidar_x_m;
    drive.lidar_z_m = car_.lidar_z_m;
    drive.lidar = report_.lidar;
    drive.imu = angles_of(T_vehicle_imu.linear());
    drive.wheelbase_m = car_.wheelbase_m;
    drive.track_m = car_.track_m;
    drive.steering_ratio = car_.steering_ratio;
    drive.anchor = report_.anchor;
    return drive;
  }

  KittiDrive drive_;
  fs::path out_;
  const ImportProgress& progress_;
  OxtsTrack track_;
  KittiCar car_;
  HeadFit head_;
  std::vector<KittiFrame> used_;     ///< frames that went into the capture
  std::vector<SweepPoints> sweeps_;  ///< of used_
  ImportReport report_;
};

}  // namespace

Expected<ImportReport> import_kitti_raw(const fs::path& folder, const fs::path& out, const ImportProgress& progress) {
  auto drive = open_kitti_drive(folder);
  if (!drive) return tl::unexpected(drive.error());
  return KittiImport(*std::move(drive), out, progress).run();
}

}  // namespace roadvec
