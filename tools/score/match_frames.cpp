#include "tools/score/match_frames.h"

#include <cmath>

#include "core/pipeline/front_end.h"
#include "tools/score/boundaries.h"
#include "tools/score/drive_reader.h"

namespace roadvec {
namespace {

constexpr double kPairSlack_m = 0.4;  // a pair this much nearer or farther than wanted is none
constexpr double kStanding_m = 0.1;   // since the frame before

/// Steps 1 to 4 on single sweeps, beside a front end and with its odometry.
class SweepLines {
 public:
  SweepLines(const PipelineConfig& config, const FrontEndSetup& setup)
      : segmenter_(config.segment, config.window, setup.lidar, setup.max_returns_per_sweep),
        scanner_(config.virtual_scan),
        vectoriser_(config.vectorise),
        odometry_(config.odometry, setup.vehicle),
        eye_(setup.lidar.translation_m.head<2>()) {}

  /// `odometry`: of the front end before it has the sweep.
  void run(const Sweep& sweep, std::span<const MotionSample> motion, const Odometry& odometry, MatchFrame& frame) {
    odometry_ = odometry;
    const Path& path_odom = odometry_.integrate(motion, sweep.start, sweep.end);
    const Segmentation& obstacles = segmenter_.run(sweep, path_odom);
    const Pose2 T_odom_vehicle = odometry_.pose(), T_vehicle_odom = T_odom_vehicle.inverse();
    const Eigen::Vector2d eye_odom = T_odom_vehicle * eye_;
    for (const CellMap* cells : {&obstacles.structure, &obstacles.boundary}) {
      frame.sweep.append(vectoriser_.run(scanner_.run(*cells, eye_odom), T_vehicle_odom));
    }
    const Eigen::Vector2d corner_odom = obstacles.boundary.window().origin_odom();
    for (const BoundaryCell& cell : obstacles.boundary.cells()) {
      frame.points.push_back(T_vehicle_odom * (corner_odom + Eigen::Vector2d(cell.x_m, cell.y_m)));
    }
  }

 private:
  Segmenter segmenter_;
  VirtualScanner scanner_;
  Vectoriser vectoriser_;
  Odometry odometry_;  // assigned, never copied anew: a copy would lose the memory that its path has reserved
  Eigen::Vector2d eye_;
};

/// The frame ahead of `from` that is nearest to kPairDistance_m away.
std::optional<std::size_t> partner(const std::vector<MatchFrame>& frames, std::size_t from) {
  const auto miss_m = [&](std::size_t i) { return std::abs(frames[i].way_m - frames[from].way_m - kPairDistance_m); };
  std::size_t best = from + 1;
  while (best + 1 < frames.size() && miss_m(best + 1) <= miss_m(best)) ++best;
  if (best >= frames.size() || miss_m(best) > kPairSlack_m) return std::nullopt;
  return best;
}

}  // namespace

Expected<MatchFrames> match_frames(const Settings& drive, const Trajectory& truth) {
  auto reader = DriveReader::open(drive);
  if (!reader) return tl::unexpected(reader.error());
  NoProbe probe;
  FrontEnd front_end(drive.pipeline, (*reader)->setup(), probe);
  SweepLines sweep_lines(drive.pipeline, (*reader)->setup());
  MatchFrames result;
  Keyframe keyframe;
  while (const Sweep* sweep = (*reader)->next()) {
    const auto true_pose = pose_at(truth, static_cast<double>(sweep->end.ns) * 1e-9);
    MatchFrame frame;
    if (true_pose) sweep_lines.run(*sweep, (*reader)->motion(), front_end.odometry(), frame);
    (void)front_end.add(*sweep, (*reader)->motion(), &keyframe);
    if (!true_pose) continue;
    const Pose2 T_vehicle_odom = front_end.odometry().pose().inverse();
    frame.raw_lvm = moved(front_end.raw_lvm_odom(), T_vehicle_odom);
    frame.lvm = moved(front_end.lvm_odom(), T_vehicle_odom);
    frame.T_map_vehicle = *true_pose;
    if (!result.frames.empty()) {
      const MatchFrame& before = result.frames.back();
      frame.way_m = before.way_m + (true_pose->translation() - before.T_map_vehicle.translation()).norm();
    }
    result.frames.push_back(std::move(frame));
  }
  if (const std::string error = (*reader)->error(); !error.empty()) return fail(error);
  result.front_end = front_end.report();
  return result;
}

std::vector<FramePair> every_pair(const std::vector<MatchFrame>& frames) {
  std::vector<FramePair> pairs;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i > 0 && frames[i].way_m - frames[i - 1].way_m < kStanding_m) continue;
    if (const auto ahead = partner(frames, i)) pairs.push_back({i, *ahead});
  }
  return pairs;
}

std::vector<FramePair> chain_of_pairs(const std::vector<MatchFrame>& frames, std::size_t count) {
  std::vector<FramePair> pairs;
  if (frames.empty()) return pairs;
  const double begin_m = 0.5 * (frames.back().way_m - static_cast<double>(count) * kPairDistance_m);
  std::size_t from = 0;
  while (from + 1 < frames.size() && frames[from].way_m < begin_m) ++from;
  while (pairs.size() < count) {
    const auto ahead = partner(frames, from);
    if (!ahead) break;
    pairs.push_back({from, *ahead});
    from = *ahead;
  }
  return pairs;
}

}  // namespace roadvec
