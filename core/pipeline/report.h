#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace roadvec {

/// The steps of the flowchart, in its order. `decode` is the driver's, counted with them.
enum class Step : std::uint8_t {
  decode,
  odometry,
  segment,
  virtual_scan,
  match,
  fuse,
  vectorise,
  simplify,
  close_loop,
  optimise,
  concatenate
};
inline constexpr std::size_t kStepCount = 11;
inline constexpr std::array<const char*, kStepCount> kStepNames = {
    "decode",    "odometry", "segment",    "virtual_scan", "match",      "fuse",
    "vectorise", "simplify", "close_loop", "optimise",     "concatenate"};

/// Told at the end of every step. core has no clock: who wants times brings one (daemon/stages/step_timer.h).
class StepProbe {
 public:
  virtual ~StepProbe() = default;
  virtual void begin() noexcept = 0;          ///< a sweep or keyframe comes in
  virtual void done(Step step) noexcept = 0;  ///< the step that ran since begin() or the last done()
};

/// For callers that want no times.
class NoProbe final : public StepProbe {
 public:
  void begin() noexcept override {}
  void done(Step) noexcept override {}
};

/// What the front end counts; copied to the status once a sweep.
struct FrontEndReport {
  std::uint64_t sweep_count = 0;
  std::uint64_t match_accepted_count = 0;
  std::uint64_t match_rejected_count = 0;
  std::uint64_t keyframe_count = 0;
  std::uint64_t raw_ray_count = 0;      ///< rays that met the keyframes' lines: the paper's raw LVM
  std::uint64_t raw_vertex_count = 0;   ///< of the keyframes' raw LVMs, one for each cell met
  std::uint64_t kept_vertex_count = 0;  ///< of the same LVMs after simplify
  double travelled_m = 0;
};

}  // namespace roadvec
