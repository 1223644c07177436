#include "daemon/daemon.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <csignal>
#include <random>
#include <stdexcept>

#include "core/base/angle.h"
#include "daemon/gps_anchor.h"
#include "daemon/results.h"
#include "daemon/threads.h"

namespace roadvec {
namespace {

constexpr std::size_t kFrameLogBytes = 16 << 20;  // six minutes of deltas
constexpr std::chrono::milliseconds kSupervision{1000}, kProgress{200};
constexpr double kStuck_s = 2;    // a thread turns every 20 ms
constexpr double kStalled_s = 3;  // the process, when the main thread comes so late; and how long the status says so

template <class T>
T or_throw(Expected<T> value) {
  if (!value) throw std::runtime_error(value.error().message);
  return std::move(*value);
}

/// Told apart from every earlier map by chance; a drive's map has no clients, and the same drive gives the same bytes.
MapHead first_head(InputKind kind, const Pose2& T_map_odom) {
  std::random_device random;
  const std::uint64_t chance = (static_cast<std::uint64_t>(random()) << 32 | random()) | 1;
  return {kind == InputKind::recorded ? 1 : chance, 0, T_map_odom};
}

/// The map that a live drive goes on with. A file that cannot be read is the store's matter: it says so, and what then
/// becomes of it.
std::optional<EarlierPart> earlier_part(const Settings& settings, InputKind kind) {
  if (kind == InputKind::recorded || !settings.storage.resume) return std::nullopt;
  const std::filesystem::path file = settings.storage.directory / "map.gpkg";
  std::error_code error;
  auto written = std::filesystem::last_write_time(file, error);
  if (error) return std::nullopt;
  const auto log_written = std::filesystem::last_write_time(file.string() + "-wal", error);
  if (!error) written = std::max(written, log_written);
  const auto pause =
      std::chrono::duration_cast<std::chrono::seconds>(std::filesystem::file_time_type::clock::now() - written);
  Stored<std::optional<EarlierPart>> found = find_earlier_part(file, anchor_of(settings), pause);
  if (!found) {
    spdlog::warn("the map in {} is not gone on with: {}", file.string(), found.error().text);
    return std::nullopt;
  }
  if (!*found) {
    spdlog::info("no drive in {} came by here; a map of its own is begun", file.string());
  } else {
    spdlog::info(
        "part {} of {} came by here, {} keyframes; it is gone on with as soon as the vehicle has found itself in it",
        (*found)->part.number, file.string(), (*found)->drive.keyframes.size());
  }
  return std::move(*found);
}

}  // namespace

Daemon::Daemon(const Settings& settings, InputKind kind, Service& service, const PassedSockets& sockets)
    : settings_(settings),
      kind_(kind),
      when_full_(kind == InputKind::recorded ? WhenFull::wait : WhenFull::refuse),
      service_(service),
      sweeps_(when_full_, mapping_bell_),
      motion_(when_full_, mapping_bell_),
      keyframes_(when_full_, optimiser_bell_),
      frames_(kFrameLogBytes),
      started_(std::chrono::steady_clock::now()) {
  LidarInput lidar = or_throw(open_lidar(settings_.lidar, kind, lidar_counters_, sockets));
  if (!settings_.anchor) settings_.anchor = or_throw(anchor_from_gps(lidar, kind, service));
  VehicleInput vehicle = or_throw(open_vehicle(settings_, kind, sockets));
  imu_device_ = vehicle.imu_device;
  std::optional<EarlierPart> earlier = earlier_part(settings_, kind);
  Pose2 T_map_odom_start{0, 0, rad_from_deg(settings_.anchor->yaw_deg)};
  if (earlier) {
    const Anchor& anchor = earlier->part.anchor;
    settings_.anchor = {anchor.latitude_deg, anchor.longitude_deg, anchor.height_m, anchor.yaw_deg};
    T_map_odom_start = earlier->drive.guesses.front().T_map_odom;
  }
  const MapHead head = first_head(kind, T_map_odom_start);
  lidar_.emplace(std::move(lidar.source), lidar.model, lidar.calibration, lidar.options, lidar_counters_, sweeps_,
                 latencies_);
  vehicle_.emplace(std::move(vehicle.inputs), motion_, settings_.lidar.clock == LidarClock::device_utc);
  mapping_.emplace(settings_.pipeline, front_end_setup(settings_, lidar.model), sweeps_, motion_, mapping_bell_,
                   keyframes_, poses_, latencies_);
  optimiser_.emplace(settings_.pipeline, keyframes_, optimiser_bell_, frames_, head, latencies_, change_stamps_,
                     kind == InputKind::live ? &journal_ : nullptr);
  if (earlier) optimiser_->recall(earlier->drive);
  if (kind == InputKind::recorded) return;
  MapServerConfig server;
  server.socket_path = settings_.server.socket;
  server.adopted_fd = sockets.map_fd;
  server.group = settings_.server.group;
  server.control_path = settings_.server.control_socket;
  server.control_fd = sockets.control_fd;
  server.most_clients = static_cast<std::size_t>(settings_.server.most_clients);
  server.most_clients_per_user = static_cast<std::size_t>(settings_.server.most_clients_per_user);
  server.start = head;
  server.facts.server_version = ROADVEC_VERSION;
  server.facts.anchor = anchor_of(settings_);
  server.facts.commands.durable_seq = [this] { return store_->report().durable_seq; };
  server.facts.commands.cannot_save = [this] {
    const StoreReport report = store_->report();
    return report.in_trouble ? report.detail : std::string();
  };
  server.facts.commands.begin_new_map = [this] { optimiser_->begin_new_map(); };
  server.on_written = [this](std::uint64_t seq, bool taken) { note_written(seq, taken); };
  server.log = [](const std::string& line) { spdlog::warn("{}", line); };
  server_.emplace(server, frames_, poses_, [this] { return status(); });
  store_.emplace(MapStoreConfig{.directory = settings_.storage.directory,
                                .batch_interval = std::chrono::duration<double>(settings_.storage.batch_s),
                                .start = head,
                                .anchor = server.facts.anchor.value(),
                                .earlier = std::move(earlier)},
                 frames_, journal_);
}

int Daemon::run(const std::optional<std::filesystem::path>& output, const std::function<std::string()>& reload) {
  if (kind_ == InputKind::live && settings_.real_time.lock_memory && !lock_memory()) {
    spdlog::warn(
        "memory is not locked: raise LimitMEMLOCK (systemd) or ulimit -l, or set real_time.lock_memory = false");
  }
  if (!lidar_->warning().empty()) spdlog::warn("{}", lidar_->warning());
  start_threads();
  Service::ready();
  supervise(reload);
  Service::stopping();
  join_threads();
  take_reports();
  int written = output ? write_results(*output) : 0;
  if (store_report_.durable_seq < optimiser_report_.head.seq && store_) {
    spdlog::error("the end of the map is not on the disk: {}", store_report_.detail);
    written = 1;
  }
  if (kind_ == InputKind::recorded && !lidar_->warning().empty()) spdlog::warn("{}", lidar_->warning());
  if (!lidar_->error().empty()) {
    spdlog::error("{}", lidar_->error());
    return 1;
  }
  if (kind_ == InputKind::recorded && awaits_calibration()) {
    spdlog::error(
        "the recording ended before the calibration that the sensor streams was complete, so nothing was mapped; set "
        "lidar.calibration to the sensor's db.xml");
    return 1;
  }
  return written;
}

/// In the order in which data flows, so that each finds all that comes before it; the server is last, so that clients
/// hear what became of it.
void Daemon::join_threads() {
  input_stop_.request_stop();
  for (std::jthread& thread : threads_) thread.join();
  store_stop_.request_stop();
  if (store_thread_.joinable()) store_thread_.join();
  server_stop_.request_stop();
  if (server_thread_.joinable()) server_thread_.join();
}

void Daemon::start_threads() {
  const RealTimeSettings none{.lidar_priority = 0, .vehicle_priority = 0, .mapping_priority = 0, .lock_memory = false};
  const RealTimeSettings real_time = kind_ == InputKind::live ? settings_.real_time : none;
  const auto start = [](const char* name, int priority, int cpu, auto&& body) {
    return std::jthread([name, priority, cpu, body] {
      if (!set_up_thread(name, priority, cpu)) {
        spdlog::warn("{} runs without real-time priority {} on cpu {}: raise LimitRTPRIO, or set it to 0", name,
                     priority, cpu);
      }
      body();
    });
  };
  threads_.push_back(start("rv-lidar", real_time.lidar_priority, real_time.lidar_cpu, [this] {
    lidar_->run(input_stop_.get_token());
    input_over_ = true;
  }));
  threads_.push_back(start("rv-vehicle", real_time.vehicle_priority, real_time.vehicle_cpu,
                           [this] { vehicle_->run(input_stop_.get_token()); }));
  threads_.push_back(start("rv-mapping", real_time.mapping_priority, real_time.mapping_cpu,
                           [this] { mapping_->run(hard_stop_.get_token()); }));
  threads_.push_back(start("rv-optimiser", 0, real_time.background_cpu, [this] {
    optimiser_->run(hard_stop_.get_token());
    map_finished_ = true;
  }));
  if (kind_ == InputKind::recorded) return;
  const auto stop_for = [](const char* whose) {
    spdlog::critical("the map {} lost its copy of the map; stopping", whose);
    ::kill(::getpid(), SIGTERM);
  };
  store_thread_ = start("rv-store", 0, real_time.background_cpu, [this, stop_for] {
    if (!store_->run(store_stop_.get_token())) stop_for("store");
  });
  server_thread_ = start("rv-server", 0, real_time.background_cpu, [this, stop_for] {
    if (!server_->run(server_stop_.get_token())) stop_for("server");
  });
}

void Daemon::supervise(const std::function<std::string()>& reload) {
  const auto turn = kind_ == InputKind::live ? kSupervision : kProgress;
  while (!map_finished_) {
    const std::optional<int> signal = service_.wait_for_signal(turn);
    take_reports();
    log_progress();
    if (every_stage_moved(now_s())) service_.feed_watchdog();
    warn_of_senders();
    if (signal == SIGHUP) {
      Service::reloading();
      const std::string complaint = reload();
      Service::ready();
      const std::scoped_lock lock(reports_mutex_);
      reload_complaint_ = complaint;
      if (!complaint.empty()) ++bad_reload_count_;
    }
    if (signal == SIGINT || signal == SIGTERM) {
      spdlog::info("asked to stop: mapping what was received, then writing the map");
      return;
    }
    if (input_over_ && kind_ == InputKind::live) return;  // the socket failed
  }
}

void Daemon::warn_of_senders() {
  const Senders* const senders = lidar_->senders();
  if (senders == nullptr || !senders->ambiguous() || senders->count() == warned_sender_count_) return;
  warned_sender_count_ = senders->count();
  spdlog::warn("more than one sensor sends to UDP port {}: {}; the first is taken. Set lidar.source_address",
               settings_.lidar.port, senders->list());
}

void Daemon::take_reports() {
  const std::scoped_lock lock(reports_mutex_);
  clock_report_ = lidar_->clock().load();
  vehicle_counts_ = vehicle_->counts().load();
  mapping_report_ = mapping_->reports().load();
  if (store_) {
    StoreReport report = store_->report();
    if (report.state != store_report_.state || report.detail != store_report_.detail) {
      spdlog::log(report.in_trouble ? spdlog::level::warn : spdlog::level::info, "store: {}",
                  report.detail.empty() ? report.state : report.detail);
    }
    store_report_ = std::move(report);
  }
  // After the store's, so that what is durable is never ahead of it.
  optimiser_report_ = optimiser_->reports().load();
  if (kind_ == InputKind::live) count_recent(now_s());
}

void Daemon::count_recent(double at_s) {
  const LidarCounts lidar = snapshot(lidar_counters_);
  recent_lidar_.add(at_s, {lidar.received, lidar.device_time_gaps, lidar.reordered,
                           lidar.wrong_length + lidar.foreign_source + lidar.wrong_flags, lidar.foreign_source,
                           lidar.wrong_flags, lidar_->sweeps_published().value() + lidar.ring_full, lidar.ring_full,
                           lidar.clock_steps + clock_report_.host_step_count});
  const VehicleCounts& counts = vehicle_counts_;
  const std::size_t imu = settings_.vehicle ? 1 : 0;
  if (settings_.vehicle) {
    recent_can_.add(at_s, {counts.can.frame_count - counts.can.error_frame_count, vehicle_->activity(0).samples.value(),
                           counts.can.kernel_drop_count + counts.can.controller_overflow_count});
  }
  if (settings_.imu) {
    recent_imu_.add(at_s, {counts.imu.byte_count + counts.imu_can.frame_count - counts.imu_can.error_frame_count,
                           vehicle_->activity(imu).samples.value(), lost_of_imu(counts)});
  }
  const std::uint64_t closure_count = optimiser_report_.back_end.loops.accepted_count;
  if (closure_count > closure_count_) last_closure_s_ = at_s;
  closure_count_ = closure_count;
}

/// The store is not among them: a disk that hangs is no reason to end mapping.
bool Daemon::every_stage_moved(double at_s) {
  const std::array<std::uint64_t, kThreads> turns{lidar_->turns().value(), vehicle_->turns().value(),
                                                  mapping_->turns().value(), optimiser_->turns().value()};
  const std::scoped_lock lock(reports_mutex_);
  const double late_s = last_look_s_ > 0 ? at_s - last_look_s_ : 0;
  if (late_s > kStalled_s) {
    ++stall_count_;
    longest_stall_s_ = std::max(longest_stall_s_, late_s);
    stalled_until_s_ = at_s + kStalled_s;
    spdlog::warn("the process did not run for {:.1f} s: was it stopped, or is the machine overloaded?", late_s);
  }
  bool moved = true;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const bool turned = turns[i] != last_turns_[i];
    // Nobody turned while the process did not run.
    if (turned || late_s > kStalled_s || moved_s_[i] == 0) moved_s_[i] = at_s;
    stuck_[i] = at_s - moved_s_[i] > kStuck_s;
    moved = moved && turned;
  }
  last_turns_ = turns;
  last_look_s_ = at_s;
  return moved;
}

/// Server's thread.
void Daemon::note_written(std::uint64_t seq, bool taken) {
  for (const ChangeStamp* stamp = nullptr; (stamp = change_stamps_.front()) != nullptr && stamp->seq <= seq;) {
    if (taken) latencies_.note(Station::written, stamp->received_ns);
    change_stamps_.pop();
  }
}

void Daemon::log_progress() {
  const wire::Status now = status();
  std::string line = fmt::format("{} | {} sweeps, {} keyframes, {:.0f} m driven, {:.0f} m of boundary, {} loops",
                                 now.state, mapping_->sweep_count().value(), now.keyframe_count, now.travelled_m,
                                 now.map_length_m, now.loop_closure_count);
  if (!now.not_growing_reason.empty()) line += " | " + now.not_growing_reason;
  if (store_report_.in_trouble) line += " | " + store_report_.detail;
  Service::status(line);
  if (kind_ == InputKind::recorded) {
    if (::isatty(STDERR_FILENO) != 0) fmt::print(stderr, "\r\x1b[K{}", line);
    if (map_finished_ && ::isatty(STDERR_FILENO) != 0) fmt::print(stderr, "\n");
  } else {
    spdlog::debug("{}", line);
  }
}

int Daemon::write_results(const std::filesystem::path& output) const {
  const Results results{.back_end = optimiser_->back_end(), .anchor = anchor_of(settings_), .status = status()};
  const Expected<void> written = write_all(results, output);
  if (!written) {
    spdlog::error("{}", written.error().message);
    return 1;
  }
  spdlog::info("map written to {}: {:.0f} m of boundary in {} lines, {} keyframes", output.string(),
               results.status.map_length_m, results.status.line_count, results.status.keyframe_count);
  return 0;
}

}  // namespace roadvec
