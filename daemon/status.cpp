// What `roadvec status` shows and report.json keeps: every counter under the name of its stage.

#include <algorithm>

#include "daemon/daemon.h"

namespace roadvec {
namespace {

constexpr std::uint64_t kManyKeyframes = 8;  // 16 m of road that wait

}  // namespace

double Daemon::now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void Daemon::add_timing(wire::Stage& stage, const char* name, const DurationHistogram& histogram, bool with_buckets) {
  const DurationHistogram::Summary summary = histogram.summary();
  if (summary.count == 0) return;
  wire::Timing& timing = stage.timings.emplace_back(
      wire::Timing{name, summary.count, summary.p50_us, summary.p99_us, summary.max_us, summary.sum_us, {}});
  if (!with_buckets) return;
  const auto counts = histogram.at_most_counts();
  timing.at_most_counts.assign(counts.begin(), counts.end());
}

void Daemon::add_timing(wire::Stage& stage, const StepTimer& timer, Step step) {
  add_timing(stage, kStepNames[static_cast<std::size_t>(step)], timer.histogram(step));
}

/// The table that an HDL-64E streams is still being collected: every packet since has been put off.
bool Daemon::awaits_calibration() const {
  return settings_.lidar.calibration == kStreamedCalibration && !lidar_->calibrated();
}

wire::Stage Daemon::stage_for(const char* name, Thread thread, Health health) const {
  // A recording is read as fast as it can be: nothing of it is late or silent.
  if (kind_ == InputKind::recorded) health.state = "ok";
  if (kind_ == InputKind::live && stuck_[thread]) health = stuck();
  wire::Stage stage;
  stage.name = name;
  stage.state = health.state;
  stage.detail = health.detail;
  return stage;
}

wire::Stage Daemon::vehicle_status() const {
  wire::Stage stage = stage_for("vehicle", kVehicle, {});
  stage.counters = {{"samples", vehicle_->sample_count().value()},
                    {"ring_full", vehicle_->refused_count().value()},
                    {"misses", vehicle_->misses().value()}};
  add_timing(stage, "turn", vehicle_->turn_times());
  return stage;
}

wire::Stage Daemon::mapping_status() const {
  const MappingReport& report = mapping_report_;
  const bool matched =
      report.last_match == MatchVerdict::accepted || report.last_match == MatchVerdict::partly_observable;
  wire::Stage stage =
      stage_for("mapping", kMapping,
                health_of(MappingFacts{.age_s = kind_ == InputKind::recorded ? 0 : mapping_->last_sweep().age_s(),
                                       .refused_hz = recent_lidar_.rate_hz(kRefused),
                                       .speed = report.speed_source,
                                       .yaw = report.yaw_source,
                                       .matched = matched}));
  stage.counters = {{"sweeps", report.front_end.sweep_count},
                    {"matched", report.front_end.match_accepted_count},
                    {"unmatched", report.front_end.match_rejected_count},
                    {"keyframes", report.front_end.keyframe_count},
                    {"late_motion", mapping_->late_motion_count().value()},
                    {"misses", mapping_->misses().value()},
                    {"raw_rays", report.front_end.raw_ray_count},
                    {"raw_vertices", report.front_end.raw_vertex_count},
                    {"kept_vertices", report.front_end.kept_vertex_count}};
  stage.gauges = {{"gyro_bias_radps", report.gyro_bias_radps},
                  {"speed_scale", report.speed_scale},
                  {"steering_offset_rad", report.steering_offset_rad}};
  if (report.unobservable_rad) stage.gauges.push_back({"unobservable_rad", *report.unobservable_rad});
  for (const Step step :
       {Step::odometry, Step::segment, Step::virtual_scan, Step::match, Step::fuse, Step::vectorise, Step::simplify}) {
    add_timing(stage, mapping_->timer(), step);
  }
  add_timing(stage, "sweep", mapping_->sweep_times());
  return stage;
}

wire::Stage Daemon::optimiser_status() const {
  const std::uint64_t waiting_count = keyframes_.size();
  Health health;
  if (waiting_count >= kManyKeyframes)
    health = {"behind", "keyframes wait for it: the processor is too slow or too busy; the map is behind the car"};
  wire::Stage stage = stage_for("optimiser", kOptimiser, health);
  const BackEndReport& report = optimiser_report_.back_end;
  if (health.ok() && !report.found_itself) stage.detail = "the vehicle has not found itself in the stored map yet";
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
                    {"map_vertices", report.vertex_count},
                    {"misses", optimiser_->misses().value()}};
  stage.gauges = {{"waiting_keyframes", static_cast<double>(waiting_count)}};
  if (report.recalled_keyframe_count > 0) {
    stage.gauges.push_back({"recalled_keyframes", static_cast<double>(report.recalled_keyframe_count)});
    stage.gauges.push_back({"searched_m", report.searched_m});
  }
  if (closure_count_ > 0) stage.gauges.push_back({"last_closure_age_s", now_s() - last_closure_s_});
  for (const Step step : {Step::close_loop, Step::optimise, Step::concatenate})
    add_timing(stage, optimiser_->timer(), step);
  add_timing(stage, "keyframe", optimiser_->keyframe_times());
  return stage;
}

wire::Stage Daemon::latency_status() const {
  wire::Stage stage;
  stage.name = "latency";
  stage.state = "ok";
  for (std::size_t i = 0; i < kStationNames.size(); ++i)
    add_timing(stage, kStationNames[i], latencies_.at(static_cast<Station>(i)), true);
  return stage;
}

wire::Stage Daemon::process_status() const {
  wire::Stage stage;
  stage.name = "process";
  stage.state = now_s() < stalled_until_s_ ? "stalled" : "ok";
  if (stage.state != "ok") stage.detail = "it did not run for seconds: was it stopped, or is the machine overloaded?";
  if (stage.state == "ok" && !reload_complaint_.empty()) {
    stage.state = "misconfigured";
    stage.detail = "the file read again is wrong, and changes nothing: " + reload_complaint_;
  }
  stage.counters = {{"stalls", stall_count_}, {"bad_reloads", bad_reload_count_}};
  stage.gauges = {{"longest_stall_s", longest_stall_s_}};
  return stage;
}

wire::Stage Daemon::store_status() const {
  const StoreReport& report = store_report_;
  wire::Stage stage;
  stage.name = "store";
  stage.state = report.state;
  stage.detail = report.detail;
  stage.counters = {{"batches", report.batch_count},
                    {"failed_batches", report.failed_count},
                    {"opened", report.opened_count},
                    {"set_aside", report.set_aside_count}};
  stage.gauges = {{"unwritten_lines", static_cast<double>(report.unwritten_line_count)},
                  {"file_bytes", report.file_bytes},
                  {"log_bytes", report.log_bytes},
                  {"longest_batch_ms", report.longest_batch_ms}};
  return stage;
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
  status.stages = {lidar_status(), clock_status()};
  if (settings_.vehicle) status.stages.push_back(can_status());
  if (settings_.imu) status.stages.push_back(imu_status());
  for (const auto& stage : {vehicle_status(), mapping_status(), optimiser_status()}) status.stages.push_back(stage);
  if (kind_ == InputKind::live) status.stages.push_back(latency_status());
  if (store_) status.stages.push_back(store_status());
  if (kind_ == InputKind::live) status.stages.push_back(process_status());
  judge(status);
  return status;
}

/// The one word, and why the map does not grow.
void Daemon::judge(wire::Status& status) const {
  status.state = map_finished_ ? "finished" : input_over_ ? "finishing" : "mapping";
  if (input_over_ || map_finished_) return;
  const auto stage = [&](const char* name) -> const wire::Stage& {
    return *std::ranges::find(status.stages, name, &wire::Stage::name);
  };
  // Without these two nothing is added to the map; without the others less, or with less certainty.
  const std::array<const char*, 6> stops_the_map = {"waiting",      "silent",     "unreadable",
                                                    "uncalibrated", "incomplete", "stuck"};
  const wire::Stage &lidar = stage("lidar"), &mapping = stage("mapping"), &optimiser = stage("optimiser");
  if (kind_ == InputKind::recorded) {
    if (awaits_calibration()) status.not_growing_reason = lidar.detail;
  } else if (std::ranges::find(stops_the_map, lidar.state) != stops_the_map.end()) {
    status.not_growing_reason = lidar.detail;
  } else if (mapping.state == "stuck" || mapping.state == "motionless") {
    status.not_growing_reason = mapping.detail;
  } else if (optimiser.state == "stuck") {
    status.not_growing_reason = optimiser.detail;
  }
  const bool all_ok = std::ranges::all_of(status.stages, [](const wire::Stage& s) { return s.state == "ok"; });
  if (!all_ok) status.state = "degraded";
  if (!status.not_growing_reason.empty()) status.state = "waiting";
}

}  // namespace roadvec
