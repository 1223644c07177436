// The sensors' part of the status.

#include "daemon/clock_text.h"
#include "daemon/daemon.h"

namespace roadvec {
namespace {

double seconds_from_ns(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

void add_age(wire::Stage& stage, const LastHeard& last) {
  if (const auto age_s = last.age_s()) stage.gauges.push_back({"age_s", *age_s});
}

}  // namespace

wire::Stage Daemon::lidar_status() const {
  const Senders* const senders = lidar_->senders();
  const LidarCounts counts = snapshot(lidar_counters_);
  const auto rate_hz = [&](LidarCount i) { return recent_lidar_.rate_hz(i); };
  // device_time_gaps counts what came too late as missing.
  const double missing_hz = std::max(0.0, rate_hz(kMissing) - rate_hz(kDisordered));
  Health health = health_of(LidarFacts{.awaits_calibration = awaits_calibration(),
                                       .ambiguous = senders != nullptr && senders->ambiguous() && rate_hz(kForeign) > 0,
                                       .age_s = lidar_->last_packet().age_s(),
                                       .good_hz = rate_hz(kReceived) - rate_hz(kWrongFlags),
                                       .missing_hz = missing_hz,
                                       .disordered_hz = rate_hz(kDisordered),
                                       .noise_hz = rate_hz(kNoise),
                                       .revolutions_hz = rate_hz(kRevolutions),
                                       .revolution_count = lidar_->sweeps_published().value() + counts.ring_full,
                                       .noise_count = counts.wrong_length + counts.foreign_source + counts.wrong_flags,
                                       .senders = senders == nullptr ? "" : senders->list()});
  if (input_over_ || (kind_ == InputKind::recorded && !awaits_calibration())) health = {};
  wire::Stage stage = stage_for("lidar", kLidar, std::move(health));
  visit_counters(lidar_counters_, [&stage](const char* name, const Counter& counter) {
    stage.counters.push_back({name, counter.value()});
  });
  stage.counters.push_back({"sweeps", lidar_->sweeps_published().value()});
  stage.counters.push_back({"dropped", counts.device_time_gaps});
  stage.counters.push_back({"misses", lidar_->misses().value()});
  if (kind_ == InputKind::live) {
    stage.gauges = {{"rate_hz", rate_hz(kRevolutions) - rate_hz(kRefused)}, {"packets_hz", rate_hz(kReceived)}};
    add_age(stage, lidar_->last_packet());
  }
  add_timing(stage, "decode", lidar_->timer().histogram(Step::decode));
  return stage;
}

wire::Stage Daemon::clock_status() const {
  const SensorClockReport& gps = clock_report_.gps;
  const PacketClockState& stamps = clock_report_.stamps;
  const bool stepped = recent_lidar_.growth(kSteps) > 0;
  wire::Stage stage =
      stage_for("clock", kLidar, {stepped ? "stepped" : "ok", clock_text(settings_.lidar.clock, clock_report_)});
  stage.counters = {{"clock_steps", lidar_counters_.clock_steps.value()},
                    {"host_steps", clock_report_.host_step_count},
                    {"position_packets", gps.position_packet_count},
                    {"nmea_sentences", gps.nmea_count},
                    {"nmea_bad", gps.nmea_bad_count}};
  stage.gauges = {{"device_minus_host_s", seconds_from_ns(stamps.device_minus_host_ns)}};
  if (stamps.last_step) stage.gauges.push_back({"last_step_s", seconds_from_ns(stamps.last_step->size_ns)});
  if (clock_report_.host_step_count > 0)
    stage.gauges.push_back({"last_host_step_s", seconds_from_ns(clock_report_.last_host_step_ns)});
  if (gps.device_after_nmea_ns)
    stage.gauges.push_back({"device_after_nmea_s", seconds_from_ns(*gps.device_after_nmea_ns)});
  if (gps.host_after_nmea_ns) stage.gauges.push_back({"host_after_nmea_s", seconds_from_ns(*gps.host_after_nmea_ns)});
  if (gps.temperature_c) stage.gauges.push_back({"sensor_temperature_degc", *gps.temperature_c});
  return stage;
}

wire::Stage Daemon::can_status() const {
  const CanCounters& can = vehicle_counts_.can;
  const MotionCounters& motion = vehicle_counts_.motion;
  const LastHeard& last = vehicle_->activity(0).last_sample;
  Health health = health_of(CanFacts{.state = can.state,
                                     .age_s = last.age_s(),
                                     .frames_hz = recent_can_.newest_hz(kRaw),
                                     .lost_hz = recent_can_.rate_hz(kLost)});
  if (kind_ == InputKind::recorded) health = {};
  wire::Stage stage = stage_for("can", kVehicle, std::move(health));
  stage.counters = {{"frames", can.frame_count},
                    {"dropped", can.kernel_drop_count + can.controller_overflow_count},
                    {"bad_lines", can.bad_line_count},
                    {"kernel_drops", can.kernel_drop_count},
                    {"wrong_size", can.wrong_size_count},
                    {"foreign_interface", can.foreign_interface_count},
                    {"error_frames", can.error_frame_count},
                    {"bus_off", can.bus_off_count},
                    {"restarted", can.restarted_count},
                    {"passive", can.passive_count},
                    {"controller_problems", can.controller_problem_count},
                    {"controller_overflows", can.controller_overflow_count},
                    {"bus_errors", can.bus_error_count},
                    {"other_errors", can.other_error_count},
                    {"interface_down", can.interface_down_count},
                    {"interface_lost", can.interface_lost_count},
                    {"interface_reopened", can.reopened_count},
                    {"short_frames", motion.short_frame_count},
                    {"invalid_values", motion.invalid_value_count},
                    {"not_valid", motion.not_valid_count},
                    {"bad_checksums", motion.messages.bad_checksum_count},
                    {"counter_gaps", motion.messages.counter_gap_count},
                    {"message_timeouts", motion.messages.timeout_count}};
  if (kind_ == InputKind::recorded) return stage;
  stage.gauges = {{"rate_hz", recent_can_.rate_hz(kSamples)},
                  {"receive_buffer_bytes", static_cast<double>(can.receive_buffer_bytes)}};
  add_age(stage, last);
  return stage;
}

wire::Stage Daemon::imu_status() const {
  const VehicleCounts& counts = vehicle_counts_;
  const std::size_t input = settings_.vehicle ? 1 : 0;
  const LastHeard& last = vehicle_->activity(input).last_sample;
  const bool on_can = settings_.imu->protocol == ImuProtocol::can;
  const bool lost =
      on_can ? counts.imu_can.state != CanState::working : counts.imu.device_lost_count > counts.imu.reopened_count;
  Health health = health_of(ImuFacts{.device_is_lost = lost,
                                     .age_s = last.age_s(),
                                     .bytes_hz = recent_imu_.newest_hz(kRaw),
                                     .samples_hz = recent_imu_.rate_hz(kSamples),
                                     .bad_hz = recent_imu_.rate_hz(kLost)});
  if (kind_ == InputKind::recorded) health = {};
  if (health.ok() && !imu_device_.empty()) health.detail = imu_device_;
  wire::Stage stage = stage_for("imu", kVehicle, std::move(health));
  stage.counters = {{"dropped", lost_of_imu(counts)}};
  if (on_can) {
    for (const wire::Counter& counter : {wire::Counter{"frames", counts.imu_can.frame_count},
                                         {"kernel_drops", counts.imu_can.kernel_drop_count},
                                         {"short_frames", counts.imu_motion.short_frame_count},
                                         {"invalid_values", counts.imu_motion.invalid_value_count}})
      stage.counters.push_back(counter);
  } else {
    for (const wire::Counter& counter :
         {wire::Counter{"bytes", counts.imu.byte_count},
          {"bad_lines", counts.imu.bad_line_count},
          {"device_lost", counts.imu.device_lost_count},
          {"device_reopened", counts.imu.reopened_count},
          {"kernel_drops", counts.imu.kernel_drop_count},
          {"bad_checksums", counts.xsens.bad_checksum_count + counts.ncom.bad_checksum_count},
          {"lost_messages", counts.xsens.lost_message_count},
          {"skipped_bytes", counts.xsens.skipped_byte_count + counts.ncom.skipped_byte_count},
          {"not_ready", counts.ncom.not_ready_count}})
      stage.counters.push_back(counter);
  }
  if (kind_ == InputKind::recorded) return stage;
  stage.gauges = {{"rate_hz", recent_imu_.rate_hz(kSamples)}};
  add_age(stage, last);
  return stage;
}

}  // namespace roadvec
