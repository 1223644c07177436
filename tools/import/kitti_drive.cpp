#include "tools/import/kitti_drive.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>

#include "tools/recording/output_file.h"

namespace roadvec {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kLargestFile_bytes = 64U << 20;
/// A revolution at 5 to 20 Hz [VelodyneHDL64].
constexpr std::int64_t kShortestScan_ns = 45'000'000, kLongestScan_ns = 210'000'000;

Expected<std::string> read_file(const fs::path& path) {
  std::error_code code;
  const std::uintmax_t size = fs::file_size(path, code);
  if (code) return fail("cannot read " + path.string() + ": " + code.message());
  if (size > kLargestFile_bytes) return fail(path.string() + " is too large for a file of KITTI's raw data");
  std::ifstream file(path, std::ios::binary);
  std::string bytes(static_cast<std::size_t>(size), '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) {
    return fail("cannot read " + path.string() + ": " + std::strerror(errno));
  }
  return bytes;
}

Expected<std::vector<SensorTime>> read_times(const fs::path& path) {
  const auto text = read_file(path);
  if (!text) return tl::unexpected(text.error());
  std::vector<SensorTime> times;
  std::istringstream lines(*text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line == "\r") continue;
    const auto time = parse_kitti_time(line);
    if (!time) {
      return fail(path.string() + ":" + std::to_string(times.size() + 1) + ": " + time.error().message +
                  "; unpack the drive again");
    }
    times.push_back(*time);
  }
  return times;
}

std::string frame_name(std::size_t index) { return print("%010zu", index); }

/// Scans that are there, each with its times.
Expected<void> find_frames(const fs::path& folder, KittiDrive& drive) {
  const auto starts = read_times(folder / "timestamps_start.txt");
  if (!starts) return tl::unexpected(starts.error());
  const auto ends = read_times(folder / "timestamps_end.txt");
  if (!ends) return tl::unexpected(ends.error());
  if (starts->size() != ends->size()) {
    return fail((folder / "timestamps_start.txt").string() + " has " + std::to_string(starts->size()) +
                " lines, timestamps_end.txt " + std::to_string(ends->size()) + "; unpack the drive again");
  }
  for (std::size_t i = 0; i < starts->size(); ++i) {
    KittiFrame frame{frame_name(i), folder / "data" / (frame_name(i) + ".bin"), (*starts)[i], (*ends)[i]};
    const std::int64_t duration_ns = frame.end - frame.start;
    std::error_code code;
    if (!fs::exists(frame.path, code)) {
      leave_out(drive.left_out, frame.name, "there is no such scan");
    } else if (duration_ns < kShortestScan_ns || duration_ns > kLongestScan_ns) {
      leave_out(drive.left_out, frame.name,
                print("its times are %.3f s apart", 1e-9 * static_cast<double>(duration_ns)));
    } else if (!drive.frames.empty() && frame.start < drive.frames.back().end - 1'000'000) {
      leave_out(drive.left_out, frame.name, "it begins before the one before it ends");
    } else {
      drive.frames.push_back(std::move(frame));
    }
  }
  if (drive.frames.empty()) {
    return fail((folder / "data").string() + " has no scans (0000000000.bin, ...); import a \"_sync\" drive");
  }
  return {};
}

Expected<void> read_oxts(const fs::path& folder, KittiDrive& drive) {
  const auto times = read_times(folder / "timestamps.txt");
  if (!times) return tl::unexpected(times.error());
  for (std::size_t i = 0; i < times->size(); ++i) {
    const auto text = read_file(folder / "data" / (frame_name(i) + ".txt"));
    const auto sample = text ? parse_oxts(*text) : tl::unexpected(text.error());
    if (!sample) {
      leave_out(drive.left_out, "OXTS " + frame_name(i), sample.error().message);
    } else if (!drive.oxts.empty() && (*times)[i] <= drive.oxts.back().time) {
      leave_out(drive.left_out, "OXTS " + frame_name(i), "its time goes back");
    } else {
      drive.oxts.push_back(*sample);
      drive.oxts.back().time = (*times)[i];
    }
  }
  if (drive.oxts.size() < 2) return fail((folder / "data").string() + " has fewer than two rows that can be read");
  return {};
}

}  // namespace

void leave_out(std::vector<LeftOut>& left_out, const std::string& name, const std::string& reason) {
  if (left_out.empty() || left_out.back().reason != reason) left_out.push_back({name, name, 0, reason});
  left_out.back().last = name;
  ++left_out.back().count;
}

Expected<KittiDrive> open_kitti_drive(const fs::path& folder) {
  std::error_code code;
  for (const char* part : {"oxts", "velodyne_points"}) {
    if (fs::is_directory(folder / part, code)) continue;
    return fail(folder.string() + " has no folder " + part +
                "; name a drive of KITTI's raw data, like 2011_09_26/2011_09_26_drive_0005_sync");
  }
  const fs::path absolute = fs::absolute(folder / "").parent_path();
  const fs::path calibration = absolute.parent_path() / "calib_imu_to_velo.txt";
  const auto text = read_file(calibration);
  if (!text) return fail(text.error().message + "; unpack the day's calibration beside the drive");
  const auto rigid = parse_rigid(*text);
  if (!rigid) return fail(calibration.string() + ": " + rigid.error().message + "; unpack the day's calibration again");
  KittiDrive drive;
  drive.T_lidar_imu = *rigid;
  return read_oxts(folder / "oxts", drive)
      .and_then([&] { return find_frames(folder / "velodyne_points", drive); })
      .map([&] { return std::move(drive); });
}

Expected<std::vector<KittiPoint>> load_scan(const KittiFrame& frame) {
  const auto bytes = read_file(frame.path);
  if (!bytes) return tl::unexpected(bytes.error());
  return parse_scan({reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()});
}

}  // namespace roadvec
