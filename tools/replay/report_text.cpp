#include "tools/replay/report_text.h"

#include <array>
#include <cstdarg>
#include <cstdio>

namespace roadvec {
namespace {

__attribute__((format(printf, 1, 2))) std::string print(const char* format, ...) {
  std::array<char, 256> buffer{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer.data(), buffer.size(), format, arguments);
  va_end(arguments);
  return buffer.data();
}

std::string json_text(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20) {
      quoted += print("\\u%04x", static_cast<unsigned>(c));
    } else {
      if (c == '"' || c == '\\') quoted += '\\';
      quoted += c;
    }
  }
  return quoted + "\"";
}

double rate(const PlayReport& report) { return report.taken_s > 0 ? report.played_s / report.taken_s : 0.0; }

unsigned long long number(std::uint64_t count) { return count; }

}  // namespace

std::string plan_text(const std::string& drive, const PlayPlan& plan, const Player::Tracks& tracks) {
  std::string text = "playing " + drive;
  text += plan.as_fast_as_possible ? " as fast as possible" : print(" at %g times its speed", plan.speed);
  if (plan.from_s > 0) text += print(", from %g s", plan.from_s);
  if (plan.to_s < 1e9) text += print(", to %g s", plan.to_s);
  text += plan.loop ? ", again and again\n" : "\n";
  for (const auto& track : tracks) {
    text += print("  %-6s", track->name().c_str());
    text += track->has_output() ? " -> " + track->destination() : " not played: no output was asked for";
    text += "\n";
  }
  return text;
}

std::string progress_text(const PlayReport& report, const Player::Tracks& tracks) {
  std::string text = print("%8.1f s", report.played_s);
  for (const auto& track : tracks) {
    if (track->has_output()) text += print("  %s %llu", track->name().c_str(), number(track->counters().sent_count));
  }
  return text + print("  %.2f x  worst lateness %.2f ms", rate(report), report.worst_lateness_s * 1e3);
}

std::string report_text(const PlayReport& report, const Player::Tracks& tracks) {
  std::string text;
  for (const auto& track : tracks) {
    if (!track->has_output()) continue;
    const Track::Counters& counters = track->counters();
    text += print("  %-6s %10llu sent  %12llu bytes  %8llu lost  %8llu skipped\n", track->name().c_str(),
                  number(counters.sent_count), number(counters.sent_bytes), number(counters.lost_count),
                  number(counters.skipped_count));
    if (!track->warning().empty()) text += "  " + track->warning() + "\n";
  }
  text += print("%s: %.3f s of the drive in %.3f s (%.3f x), worst lateness %.3f ms\n",
                report.interrupted ? "interrupted" : "played", report.played_s, report.taken_s, rate(report),
                report.worst_lateness_s * 1e3);
  return text;
}

std::string report_json(const std::string& drive, const PlayPlan& plan, const PlayReport& report,
                        const Player::Tracks& tracks) {
  std::string text = "{\"drive\": " + json_text(drive);
  text += plan.as_fast_as_possible ? ", \"speed\": null" : print(", \"speed\": %g", plan.speed);
  text += print(", \"played_s\": %.6f, \"taken_s\": %.6f, \"rate\": %.6f, \"worst_lateness_s\": %.6f", report.played_s,
                report.taken_s, rate(report), report.worst_lateness_s);
  text += print(", \"loop_count\": %llu, \"interrupted\": %s, \"tracks\": [", number(report.loop_count),
                report.interrupted ? "true" : "false");
  const char* separator = "";
  for (const auto& track : tracks) {
    if (!track->has_output()) continue;
    const Track::Counters& counters = track->counters();
    text += separator + ("{\"name\": " + json_text(track->name())) + ", \"to\": " + json_text(track->destination());
    text += print(", \"sent_count\": %llu, \"sent_bytes\": %llu, \"lost_count\": %llu, \"skipped_count\": %llu",
                  number(counters.sent_count), number(counters.sent_bytes), number(counters.lost_count),
                  number(counters.skipped_count));
    text += ", \"warning\": " + json_text(track->warning()) + "}";
    separator = ", ";
  }
  return text + "]}\n";
}

}  // namespace roadvec
