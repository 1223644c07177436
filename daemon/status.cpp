// What `roadvec status` shows and report.json keeps: every counter under the name of its stage.

#include "daemon/clock_text.h"
#include "daemon/daemon.h"

namespace roadvec {
namespace {

const char* name_of(MotionSource source) {
  switch (source) {
    case MotionSource::none:
      return "none";
    case MotionSource::matching:
      return "matching";
    case MotionSource::steering:
      return "steering";
    case MotionSource::imu:
      return "imu";
    case MotionSource::wheels:
      return "wheels";
  }
  return "none";
}

/// Why the bus is silent, and what helps; null: it is not, or nobody said why.
const char* trouble_of(const CanCounters& can) {
  switch (can.state) {
    case CanState::working:
      return nullptr;
    case CanState::bus_off:
      return "CAN controller is bus-off: check bit rate and wiring; 'ip link set IFACE type can restart-ms 100' "
             "restarts it "
             "by itself, '... type can restart' once";
    case CanState::down:
      return "CAN interface is down: 'ip link set IFACE up'";
    case CanState::lost:
      return "CAN interface has gone: it is opened again when one of its name is back";
  }
  return nullptr;
}

double seconds_from_ns(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

std::string from_whom(const Senders* senders) {
  return senders == nullptr || senders->count() == 0 ? "" : " from " + senders->list();
}

void add_timing(wire::Stage& stage, const StepTimer& timer, Step step) {
  const DurationHistogram::Summary summary = timer.summary(step);
  if (summary.count == 0) return;
  stage.timings.push_back(
      {kStepNames[static_cast<std::size_t>(step)], summary.count, summary.p50_us, summary.p99_us, summary.max_us});
}

}  // namespace

/// The table that an HDL-64E streams is still being collected: every packet since has been put off.
bool Daemon::awaits_calibration() const {
  return settings_.lidar.calibration == kStreamedCalibration && !lidar_->calibrated();
}

wire::Stage Daemon::lidar_status() const {
  wire::Stage stage{
      .name = "lidar", .state = input_over_ ? "over" : "receiving", .counters = {}, .gauges = {}, .timings = {}};
  if (lidar_counters_.received.value() == 0 && !input_over_) stage.state = "no packets";
  if (awaits_calibration() && !input_over_) stage.state = "waiting for the sensor's calibration";
  if (const Senders* senders = lidar_->senders(); senders != nullptr && senders->ambiguous()) {
    stage.state += ", the first of " + senders->list() + ": set lidar.source_address";
  }
  visit_counters(lidar_counters_, [&stage](const char* name, const Counter& counter) {
    stage.counters.push_back({name, counter.value()});
  });
  stage.counters.push_back({"sweeps", lidar_->sweeps_published().value()});
  add_timing(stage, lidar_->timer(), Step::decode);
  return stage;
}

wire::Stage Daemon::clock_status() const {
  const SensorClockReport& gps = clock_report_.gps;
  const PacketClockState& stamps = clock_report_.stamps;
  wire::Stage stage{.name = "clock",
                    .state = clock_text(settings_.lidar.clock, clock_report_),
                    .counters = {},
                    .gauges = {},
                    .timings = {}};
  stage.counters = {{"clock_steps", lidar_counters_.clock_steps.value()},
                    {"position_packets", gps.position_packet_count},
                    {"nmea_sentences", gps.nmea_count},
                    {"nmea_bad", gps.nmea_bad_count}};
  stage.gauges = {{"device_minus_host_s", seconds_from_ns(stamps.device_minus_host_ns)}};
  if (stamps.last_step) stage.gauges.push_back({"last_step_s", seconds_from_ns(stamps.last_step->size_ns)});
  if (gps.device_after_nmea_ns)
    stage.gauges.push_back({"device_after_nmea_s", seconds_from_ns(*gps.device_after_nmea_ns)});
  if (gps.host_after_nmea_ns) stage.gauges.push_back({"host_after_nmea_s", seconds_from_ns(*gps.host_after_nmea_ns)});
  if (gps.temperature_c) stage.gauges.push_back({"sensor_temperature_degc", *gps.temperature_c});
  return stage;
}

wire::Stage Daemon::vehicle_status() const {
  wire::Stage stage{.name = "vehicle", .state = "receiving", .counters = {}, .gauges = {}, .timings = {}};
  if (vehicle_->sample_count().value() == 0) stage.state = "silent";
  if (!imu_device_.empty()) stage.state += ", IMU " + imu_device_;
  stage.counters = {{"samples", vehicle_->sample_count().value()}, {"ring_full", vehicle_->refused_count().value()}};
  const VehicleCounts& counts = vehicle_counts_;
  if (settings_.vehicle) {
    for (const wire::Counter& counter : {wire::Counter{"can_frames", counts.can.frame_count},
                                         {"can_bad_lines", counts.can.bad_line_count},
                                         {"can_kernel_drops", counts.can.kernel_drop_count},
                                         {"can_wrong_size", counts.can.wrong_size_count},
                                         {"can_foreign_interface", counts.can.foreign_interface_count},
                                         {"can_error_frames", counts.can.error_frame_count},
                                         {"can_bus_off", counts.can.bus_off_count},
                                         {"can_restarted", counts.can.restarted_count},
                                         {"can_passive", counts.can.passive_count},
                                         {"can_controller_problems", counts.can.controller_problem_count},
                                         {"can_controller_overflows", counts.can.controller_overflow_count},
                                         {"can_bus_errors", counts.can.bus_error_count},
                                         {"can_other_errors", counts.can.other_error_count},
                                         {"can_interface_down", counts.can.interface_down_count},
                                         {"can_interface_lost", counts.can.interface_lost_count},
                                         {"can_interface_reopened", counts.can.reopened_count},
                                         {"can_short_frames", counts.motion.short_frame_count},
                                         {"can_invalid_values", counts.motion.invalid_value_count},
                                         {"can_not_valid", counts.motion.not_valid_count},
                                         {"can_bad_checksums", counts.motion.messages.bad_checksum_count},
                                         {"can_counter_gaps", counts.motion.messages.counter_gap_count},
                                         {"can_message_timeouts", counts.motion.messages.timeout_count}}) {
      stage.counters.push_back(counter);
    }
    if (counts.can.receive_buffer_bytes > 0) {
      stage.gauges.push_back({"can_receive_buffer_bytes", static_cast<double>(counts.can.receive_buffer_bytes)});
    }
    if (const char* trouble = trouble_of(counts.can)) stage.state = trouble;
  }
  if (settings_.imu) {
    for (const wire::Counter& counter :
         {wire::Counter{"imu_bytes", counts.imu.byte_count},
          {"imu_bad_lines", counts.imu.bad_line_count},
          {"imu_device_lost", counts.imu.device_lost_count},
          {"imu_kernel_drops", counts.imu.kernel_drop_count},
          {"imu_bad_checksums", counts.xsens.bad_checksum_count + counts.ncom.bad_checksum_count},
          {"imu_lost_messages", counts.xsens.lost_message_count},
          {"imu_not_ready", counts.ncom.not_ready_count}}) {
      stage.counters.push_back(counter);
    }
  }
  if (settings_.imu && settings_.imu->protocol == ImuProtocol::can) {
    for (const wire::Counter& counter : {wire::Counter{"imu_can_frames", counts.imu_can.frame_count},
                                         {"imu_can_kernel_drops", counts.imu_can.kernel_drop_count},
                                         {"imu_can_short_frames", counts.imu_motion.short_frame_count},
                                         {"imu_can_invalid_values", counts.imu_motion.invalid_value_count}}) {
      stage.counters.push_back(counter);
    }
  }
  return stage;
}

wire::Stage Daemon::mapping_status() const {
  const MappingReport& report = mapping_report_;
  wire::Stage stage{.name = "mapping", .state = {}, .counters = {}, .gauges = {}, .timings = {}};
  stage.state = std::string("speed from ") + name_of(report.speed_source) + ", yaw from " + name_of(report.yaw_source);
  stage.counters = {{"sweeps", report.front_end.sweep_count},
                    {"matched", report.front_end.match_accepted_count},
                    {"unmatched", report.front_end.match_rejected_count},
                    {"keyframes", report.front_end.keyframe_count},
                    {"late_motion", mapping_->late_motion_count().value()},
                    {"raw_rays", report.front_end.raw_ray_count},
                    {"raw_vertices", report.front_end.raw_vertex_count},
                    {"kept_vertices", report.front_end.kept_vertex_count}};
  stage.gauges = {{"gyro_bias_radps", report.gyro_bias_radps},
                  {"speed_scale", report.speed_scale},
                  {"steering_offset_rad", report.steering_offset_rad}};
  for (const Step step :
       {Step::odometry, Step::segment, Step::virtual_scan, Step::match, Step::fuse, Step::vectorise, Step::simplify}) {
    add_timing(stage, mapping_->timer(), step);
  }
  return stage;
}

wire::Stage Daemon::optimiser_status() const {
  const BackEndReport& report = optimiser_report_.back_end;
  const char* const running = report.found_itself ? "running" : "running; has not found itself in the stored map yet";
  wire::Stage stage{
      .name = "optimiser", .state = map_finished_ ? "finished" : running, .counters = {}, .gauges = {}, .timings = {}};
  if (report.recalled_keyframe_count > 0) {
    stage.gauges = {{"recalled_keyframes", static_cast<double>(report.recalled_keyframe_count)},
                    {"searched_m", report.searched_m}};
  }
  stage.counters = {{"keyframes", report.keyframe_count},
                    {"loop_attempts", report.loops.attempt_count},
                    {"loop_no_candidate", report.loops.no_candidate_count},
                    {"loop_too_few_lines", report.loops.too_few_lines_count},
                    {"loop_poor_overlap", report.loops.poor_overlap_count},
                    {"loop_poor_fit", report.loops.poor_fit_count},
                    {"loop_diverged", report.loops.diverged_count},
                    {"loop_ambiguous", report.loops.ambiguous_count},
                    {"loop_contradicts_odometry", report.loops.contradicts_odometry_count},
                    {"loop_waiting", report.loops.waiting_count},
                    {"loop_accepted", report.loops.accepted_count},
                    {"loop_switched_off", report.loops_switched_off_count},
                    {"solves", report.optimise_count},
                    {"failed_solves", report.failed_optimise_count},
                    {"map_rederived", report.rederive_count},
                    {"map_lines", report.line_count},
                    {"map_vertices", report.vertex_count}};
  for (const Step step : {Step::close_loop, Step::optimise, Step::concatenate})
    add_timing(stage, optimiser_->timer(), step);
  return stage;
}

wire::Stage Daemon::store_status() const {
  const StoreReport& report = store_report_;
  return {.name = "store",
          .state = report.state,
          .counters = {{"batches", report.batch_count},
                       {"failed_batches", report.failed_count},
                       {"opened", report.opened_count},
                       {"set_aside", report.set_aside_count}},
          .gauges = {{"unwritten_lines", static_cast<double>(report.unwritten_line_count)},
                     {"file_bytes", report.file_bytes},
                     {"log_bytes", report.log_bytes},
                     {"longest_batch_ms", report.longest_batch_ms}},
          .timings = {}};
}

wire::Status Daemon::status() const {
  const std::scoped_lock lock(reports_mutex_);
  wire::Status status;
  status.time = mapping_report_.time;
  status.server_version = ROADVEC_VERSION;
  status.epoch = optimiser_report_.head.epoch;
  status.head_seq = optimiser_report_.head.seq;
  status.durable_seq = store_report_.durable_seq;
  const BackEndReport& back_end = optimiser_report_.back_end;
  status.keyframe_count = back_end.keyframe_count;
  status.loop_closure_count = back_end.loops.accepted_count;
  status.line_count = back_end.line_count;
  status.map_length_m = back_end.map_length_m;
  status.travelled_m = mapping_report_.front_end.travelled_m;
  status.uptime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
  status.stages = {lidar_status(), clock_status(), vehicle_status(), mapping_status(), optimiser_status()};
  if (store_) status.stages.push_back(store_status());
  status.state = map_finished_ ? "finished" : input_over_ ? "finishing" : "mapping";
  if (lidar_counters_.received.value() == 0) {
    status.not_growing_reason =
        lidar_counters_.wrong_length.value() + lidar_counters_.foreign_source.value() > 0
            ? "datagrams come" + from_whom(lidar_->senders()) + ", but none is a data packet of the configured sensor"
            : std::string("no LiDAR packets on the port");
  } else if (awaits_calibration()) {
    status.not_growing_reason = "the calibration that the sensor streams is not complete yet";
  } else if (lidar_->sweeps_published().value() == 0) {
    status.not_growing_reason = "packets come, but no whole revolution yet";
  } else if (mapping_report_.front_end.sweep_count > 0 && mapping_report_.speed_source == MotionSource::none) {
    status.not_growing_reason = "no motion: neither wheel speed nor a match";
  }
  if (store_report_.in_trouble && status.state == "mapping") status.state = "degraded";
  if (!status.not_growing_reason.empty() && !input_over_) status.state = "waiting";
  return status;
}

}  // namespace roadvec
