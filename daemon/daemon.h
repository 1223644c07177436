#pragma once

#include <array>
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "daemon/health.h"
#include "daemon/recent.h"
#include "daemon/sensors.h"
#include "daemon/server/map_server.h"
#include "daemon/service.h"
#include "daemon/stages/lidar_stage.h"
#include "daemon/stages/mapping_stage.h"
#include "daemon/stages/optimiser_stage.h"
#include "daemon/stages/vehicle_stage.h"
#include "daemon/store/map_store.h"

namespace roadvec {

/// The wiring: every ring, stage and thread.
///
///   lidar   --sweeps--> mapping --keyframes--> optimiser --frames--> server, store (live)
///                                                        --journal---------> store
///   vehicle --motion--> mapping --pose-------------------------------> server
///
/// Nothing flows back. The main thread reads counters, tells systemd and the log, and stops the rest: inputs first,
/// then each stage ends when its channel is closed and empty, so nothing that was received is lost.
class Daemon {
 public:
  /// Opens every input and socket and reserves all memory; throws std::runtime_error with one line and the remedy.
  Daemon(const Settings& settings, InputKind kind, Service& service, const PassedSockets& sockets);

  /// Until the recording is over or SIGINT or SIGTERM comes; SIGHUP calls `reload`, which gives what is wrong. Then
  /// writes the files of a finished drive to `output`, if there is one. Gives the exit status.
  int run(const std::optional<std::filesystem::path>& output, const std::function<std::string()>& reload);

  [[nodiscard]] wire::Status status() const;

 private:
  void start_threads();
  void supervise(const std::function<std::string()>& reload);
  void take_reports();
  void warn_of_senders();
  void log_progress();
  void count_recent(double at_s);
  [[nodiscard]] bool every_stage_moved(double at_s);
  void note_written(std::uint64_t seq, bool taken);
  [[nodiscard]] bool awaits_calibration() const;
  enum Thread : std::size_t { kLidar, kVehicle, kMapping, kOptimiser, kThreads };
  [[nodiscard]] wire::Stage stage_for(const char* name, Thread thread, Health health) const;
  [[nodiscard]] wire::Stage lidar_status() const;
  [[nodiscard]] wire::Stage clock_status() const;
  [[nodiscard]] wire::Stage can_status() const;
  [[nodiscard]] wire::Stage imu_status() const;
  [[nodiscard]] wire::Stage vehicle_status() const;
  [[nodiscard]] wire::Stage mapping_status() const;
  [[nodiscard]] wire::Stage optimiser_status() const;
  [[nodiscard]] wire::Stage latency_status() const;
  [[nodiscard]] wire::Stage store_status() const;
  [[nodiscard]] wire::Stage process_status() const;
  void judge(wire::Status& status) const;
  [[nodiscard]] static double now_s();  ///< on the steady clock
  static void add_timing(wire::Stage& stage, const char* name, const DurationHistogram& histogram,
                         bool with_buckets = false);
  static void add_timing(wire::Stage& stage, const StepTimer& timer, Step step);
  void join_threads();
  int write_results(const std::filesystem::path& output) const;

  Settings settings_;  ///< as configured, with the anchor
  const InputKind kind_;
  const WhenFull when_full_;
  Service& service_;

  Doorbell mapping_bell_, optimiser_bell_;
  SweepChannel sweeps_;
  MotionChannel motion_;
  KeyframeChannel keyframes_;
  Latest<PoseReport> poses_;
  FrameLog frames_;
  DriveJournal journal_;
  Latencies latencies_;
  ChangeStamps change_stamps_;

  LidarCounters lidar_counters_;
  std::optional<LidarStage> lidar_;
  std::optional<VehicleStage> vehicle_;
  std::optional<MappingStage> mapping_;
  std::optional<OptimiserStage> optimiser_;
  std::optional<MapServer> server_;
  std::optional<MapStore> store_;

  std::stop_source input_stop_, hard_stop_, store_stop_, server_stop_;
  std::atomic<bool> input_over_{false}, map_finished_{false};
  std::vector<std::jthread> threads_;  ///< of what comes before the log
  std::jthread store_thread_, server_thread_;
  std::chrono::steady_clock::time_point started_;
  std::array<std::uint64_t, kThreads> last_turns_{};
  std::size_t warned_sender_count_ = 0;
  std::string imu_device_;

  mutable std::mutex reports_mutex_;  ///< main and server thread; no real-time thread comes near it
  LidarClockReport clock_report_;
  VehicleCounts vehicle_counts_;
  MappingReport mapping_report_;
  OptimiserReport optimiser_report_;
  StoreReport store_report_;
  // What the main thread looks at once a second.
  enum LidarCount : std::size_t {
    kReceived,
    kMissing,
    kDisordered,
    kNoise,
    kForeign,
    kWrongFlags,
    kRevolutions,
    kRefused,
    kSteps,
    kLidarCounts
  };
  enum MotionCount : std::size_t { kRaw, kSamples, kLost, kMotionCounts };
  Recent<kLidarCounts> recent_lidar_;
  Recent<kMotionCounts> recent_can_, recent_imu_;
  std::array<bool, kThreads> stuck_{};
  std::array<double, kThreads> moved_s_{};  ///< when each thread last turned
  double last_look_s_ = 0, stalled_until_s_ = 0;
  std::uint64_t stall_count_ = 0, closure_count_ = 0, bad_reload_count_ = 0;
  std::string reload_complaint_;
  double longest_stall_s_ = 0, last_closure_s_ = 0;
};

}  // namespace roadvec
