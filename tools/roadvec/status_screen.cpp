#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/angle.h"
#include "tools/roadvec/commands.h"

namespace roadvec {
namespace {

constexpr std::size_t kLines = 24, kColumns = 80;
constexpr std::array<const char*, 3> kSensors = {"lidar", "can", "imu"};
struct Thread {
  const char *stage, *timing;
};
constexpr std::array<Thread, 4> kThreads = {
    {{"lidar", "decode"}, {"vehicle", "turn"}, {"mapping", "sweep"}, {"optimiser", "keyframe"}}};

/// The screen's lines, each cut at its width.
class Screen {
 public:
  template <class... T>
  void line(fmt::format_string<T...> format, T&&... values) {
    lines_.push_back(cut(fmt::format(format, std::forward<T>(values)...)));
  }
  [[nodiscard]] std::size_t room() const { return kLines - std::min(kLines, lines_.size()); }
  [[nodiscard]] std::string text() const { return fmt::format("{}\n", fmt::join(lines_, "\n")); }

 private:
  static std::string cut(std::string text) {
    if (text.size() > kColumns) text = text.substr(0, kColumns - 3) + "...";
    return text.erase(text.find_last_not_of(' ') + 1);
  }
  std::vector<std::string> lines_;
};

template <class Named>
const Named* find(const std::vector<Named>& all, std::string_view name, std::string Named::*key) {
  const auto found = std::ranges::find(all, name, key);
  return found == all.end() ? nullptr : &*found;
}
const wire::Stage* stage_of(const wire::Status& status, std::string_view name) {
  return find(status.stages, name, &wire::Stage::name);
}
std::optional<double> gauge(const wire::Stage* stage, std::string_view name) {
  const auto* found = stage == nullptr ? nullptr : find(stage->gauges, name, &wire::Gauge::name);
  return found == nullptr ? std::nullopt : std::optional(found->value);
}
std::uint64_t count(const wire::Stage* stage, std::string_view name) {
  const auto* found = stage == nullptr ? nullptr : find(stage->counters, name, &wire::Counter::name);
  return found == nullptr ? 0 : found->value;
}

std::string duration(double s) {
  const auto whole = static_cast<std::uint64_t>(std::max(s, 0.0));
  if (whole < 120) return fmt::format("{:.{}f} s", s, s < 10 ? 2 : 0);
  return fmt::format("{}:{:02}:{:02} h", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string bytes(double value) {
  if (value < 1e4) return fmt::format("{:.0f} B", value);
  return value < 1e7 ? fmt::format("{:.0f} kB", value * 1e-3) : fmt::format("{:.1f} MB", value * 1e-6);
}

std::string milliseconds(double us) { return fmt::format("{:.{}f} ms", us * 1e-3, us < 1e4 ? 2 : 0); }

void add_sensors(const wire::Status& status, Screen& screen) {
  screen.line("{:<10}{:<13}{:>12}{:>12}{:>12}", "sensor", "state", "rate", "dropped", "age");
  for (const char* name : kSensors) {
    const wire::Stage* const stage = stage_of(status, name);
    if (stage == nullptr) continue;
    const auto rate_hz = gauge(stage, "rate_hz"), age_s = gauge(stage, "age_s");
    screen.line("{:<10}{:<13}{:>12}{:>12}{:>12}", name, stage->state,
                rate_hz ? fmt::format("{:.1f} Hz", *rate_hz) : "-", count(stage, "dropped"),
                age_s ? duration(*age_s) : "never");
  }
}

void add_pose(const wire::Status& status, Screen& screen) {
  if (!status.pose) {
    screen.line("{:<10}not known yet", "pose");
    return;
  }
  const wire::Pose& pose = *status.pose;
  const Pose2& at = pose.T_map_vehicle;
  screen.line("{:<10}{:.2f} m east, {:.2f} m north, heading {:.1f} deg, {:.2f} m/s", "pose", at.x_m, at.y_m,
              deg_from_rad(at.theta_rad), pose.speed_mps);
  // Of the odometry, which drifts: turned into the vehicle's axes.
  const double c = std::cos(pose.T_odom_vehicle.theta_rad), s = std::sin(pose.T_odom_vehicle.theta_rad);
  const PoseCovariance& p = pose.covariance;
  const double along2 = c * c * p(0, 0) + 2 * c * s * p(0, 1) + s * s * p(1, 1);
  const double across2 = s * s * p(0, 0) - 2 * c * s * p(0, 1) + c * c * p(1, 1);
  const auto unobservable_rad = gauge(stage_of(status, "mapping"), "unobservable_rad");
  const std::string hidden =
      !unobservable_rad ? "every direction observed"
                        : fmt::format("not observed: {:.0f} deg {} of ahead", std::abs(deg_from_rad(*unobservable_rad)),
                                      *unobservable_rad < 0 ? "right" : "left");
  screen.line("{:<10}sigma {:.2f} m along, {:.2f} m across, {:.2f} deg; {}", "", std::sqrt(std::max(along2, 0.0)),
              std::sqrt(std::max(across2, 0.0)), deg_from_rad(std::sqrt(std::max(p(2, 2), 0.0))), hidden);
}

void add_map(const wire::Status& status, Screen& screen) {
  const wire::Stage *const optimiser = stage_of(status, "optimiser"), *const store = stage_of(status, "store"),
                           *const server = stage_of(status, "server");
  const auto closure_age_s = gauge(optimiser, "last_closure_age_s");
  screen.line("{:<10}{:.1f} m in {} lines, {} tiles; {:.0f} m driven, {} keyframes", "map", status.map_length_m,
              status.line_count, status.tile_count, status.travelled_m, status.keyframe_count);
  screen.line("{:<10}{} closed{}; {} attempts", "loops", status.loop_closure_count,
              closure_age_s ? ", the last " + duration(*closure_age_s) + " ago" : "",
              count(optimiser, "loop_attempts"));
  if (const auto recalled = gauge(optimiser, "recalled_keyframes"); recalled && optimiser != nullptr) {
    screen.line("{:<10}{:.0f} keyframes of earlier drives; {} after {:.0f} m", "stored", *recalled,
                optimiser->detail.empty() ? "found itself" : "has not found itself",
                gauge(optimiser, "searched_m").value_or(0));
  }
  if (store != nullptr) {
    screen.line("{:<10}{:<13}change {} of {} on disk, {} and {} of log", "disk", store->state, status.durable_seq,
                status.head_seq, bytes(gauge(store, "file_bytes").value_or(0)),
                bytes(gauge(store, "log_bytes").value_or(0)));
  }
  if (server != nullptr) {
    screen.line("{:<10}{:<13}{:.0f} connected, {} to take", "clients", server->state,
                gauge(server, "clients").value_or(0), bytes(gauge(server, "waiting_bytes").value_or(0)));
  }
}

void add_threads(const wire::Status& status, Screen& screen) {
  screen.line("{:<10}{:<13}{:>12}{:>12}{:>12}{:>10}", "thread", "state", "p50", "p99", "max", "misses");
  for (const Thread& thread : kThreads) {
    const wire::Stage* const stage = stage_of(status, thread.stage);
    if (stage == nullptr) continue;
    const auto* timing = find(stage->timings, thread.timing, &wire::Timing::step);
    const auto figure = [&](double wire::Timing::*us) { return timing ? milliseconds(timing->*us) : "-"; };
    screen.line("{:<10}{:<13}{:>12}{:>12}{:>12}{:>10}", thread.stage, stage->state, figure(&wire::Timing::p50_us),
                figure(&wire::Timing::p99_us), figure(&wire::Timing::max_us), count(stage, "misses"));
  }
  const wire::Stage* const latency = stage_of(status, "latency");
  for (const char* station : {"published", "written"}) {
    const auto* timing = latency == nullptr ? nullptr : find(latency->timings, station, &wire::Timing::step);
    if (timing == nullptr) continue;
    screen.line("{:<10}{:<13}{:>12}{:>12}{:>12}", "latency", station, milliseconds(timing->p50_us),
                milliseconds(timing->p99_us), milliseconds(timing->max_us));
  }
}

/// In lines that fit, the later ones indented.
std::vector<std::string> wrapped(std::string text) {
  std::vector<std::string> lines;
  while (text.size() > kColumns) {
    const std::size_t space = text.rfind(' ', kColumns);
    const std::size_t end = space == std::string::npos || space < 3 ? kColumns : space;
    lines.push_back(text.substr(0, end));
    text = "  " + text.substr(text[end] == ' ' ? end + 1 : end);
  }
  lines.push_back(text);
  return lines;
}

/// What is wrong, as far as there is room.
void add_troubles(const wire::Status& status, Screen& screen) {
  std::size_t left_out_count = 0;
  for (const wire::Stage& stage : status.stages) {
    if (stage.state == "ok" || stage.detail.empty()) continue;
    const std::vector<std::string> lines = wrapped(stage.name + ": " + stage.detail);
    // The last line is kept for how many more there are.
    if (left_out_count > 0 || lines.size() >= screen.room()) {
      ++left_out_count;
      continue;
    }
    for (const std::string& line : lines) screen.line("{}", line);
  }
  if (left_out_count > 0) screen.line("and {} more: roadvec status --json", left_out_count);
}

}  // namespace

std::string status_screen(const wire::Status& status) {
  Screen screen;
  const wire::Stage* const clock = stage_of(status, "clock");
  screen.line("roadvecd {}, up {}: {}{}", status.server_version, duration(status.uptime_s), status.state,
              status.not_growing_reason.empty() ? "" : "; the map does not grow");
  add_sensors(status, screen);
  if (clock != nullptr) screen.line("{:<10}{:<13}{}", "clock", clock->state, clock->detail);
  add_pose(status, screen);
  add_map(status, screen);
  add_threads(status, screen);
  add_troubles(status, screen);
  return screen.text();
}

}  // namespace roadvec
