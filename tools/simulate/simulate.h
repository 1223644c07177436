#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "tools/simulate/scene.h"

namespace roadvec {

struct SimulateOptions {
  std::uint64_t seed = 1;
  std::optional<std::string> maybe_model;  ///< in place of the scene's
  std::optional<double> maybe_duration_s;  ///< the drive ends here at the latest
  std::function<void(double done_s, double whole_s)> progress = [](double, double) {};
};

struct SimulateReport {
  std::string model;
  double duration_s = 0, distance_m = 0;
  std::uint64_t packet_count = 0, lost_packet_count = 0, return_count = 0;
  std::uint64_t can_frame_count = 0, imu_sample_count = 0, boundary_count = 0;
  std::uint64_t lidar_bytes = 0;
};

/// Makes the drive of a scene in a folder that is not there yet or empty. The same scene and options give the same
/// bytes.
[[nodiscard]] Expected<SimulateReport> simulate(Scene scene, const std::string& scene_name,
                                                const std::filesystem::path& out, const SimulateOptions& options);

}  // namespace roadvec
