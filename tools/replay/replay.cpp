#include "tools/replay/replay.h"

#include <arpa/inet.h>
#include <signal.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>

#include "daemon/config/load.h"
#include "tools/replay/player.h"
#include "tools/replay/report_text.h"
#include "tools/replay/tracks.h"

namespace roadvec {
namespace {

std::atomic<bool> stop{false};                          // global because a signal handler takes no argument
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may only touch such

void end_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop.store(true); };
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  ::signal(SIGPIPE, SIG_IGN);  // a reader that goes away is counted
}

std::string joined(const std::string& a, const std::string& b) { return a.empty() || b.empty() ? a + b : a + ", " + b; }

/// Opens an output if it was asked for.
template <class Output, class Target>
Expected<std::optional<Output>> maybe_open(bool wanted, const Target& target) {
  std::optional<Output> output;
  if (!wanted) return output;
  auto opened = Output::open(target);
  if (!opened) return tl::make_unexpected(opened.error());
  output.emplace(std::move(*opened));
  return output;
}

Expected<std::unique_ptr<Track>> lidar_track(const LidarSettings& lidar, const ReplayOptions& options) {
  auto data = UdpOutput::open(options.udp);
  if (!data) return tl::make_unexpected(data.error());
  auto position = maybe_open<UdpOutput>(options.position_port != 0, Endpoint{options.udp.host, options.position_port});
  if (!position) return tl::make_unexpected(position.error());
  LidarTrack::Source source{.pcap = lidar.pcap.native(), .port = lidar.port, .sender_ipv4 = std::nullopt};
  if (in_addr address{}; ::inet_pton(AF_INET, lidar.source_address.c_str(), &address) == 1)
    source.sender_ipv4 = ntohl(address.s_addr);
  return std::make_unique<LidarTrack>(source, options.udp.text(), std::move(*data), std::move(*position));
}

Expected<std::unique_ptr<Track>> can_track(const VehicleSettings& vehicle, const ReplayOptions& options) {
  auto interface = maybe_open<CanOutput>(!options.can.empty(), options.can);
  if (!interface) return tl::make_unexpected(interface.error());
  auto pipe = maybe_open<PipeOutput>(!options.can_pipe.empty(), options.can_pipe);
  if (!pipe) return tl::make_unexpected(pipe.error());
  return std::make_unique<CanTrack>(vehicle.can, joined(options.can, options.can_pipe), std::move(*interface),
                                    std::move(*pipe));
}

Expected<std::unique_ptr<Track>> imu_track(const ImuSettings& imu, const ReplayOptions& options) {
  auto terminal = maybe_open<PtyOutput>(!options.imu_pty.empty(), options.imu_pty);
  if (!terminal) return tl::make_unexpected(terminal.error());
  auto udp = maybe_open<UdpOutput>(options.imu_udp.has_value(), options.imu_udp.value_or(Endpoint{}));
  if (!udp) return tl::make_unexpected(udp.error());
  const std::string to = joined(options.imu_pty, options.imu_udp ? options.imu_udp->text() : "");
  return std::make_unique<ImuTrack>(imu.log.native(), to, std::move(*terminal), std::move(*udp));
}

Expected<Player::Tracks> open_tracks(const Settings& settings, const ReplayOptions& options) {
  const bool has_can = settings.vehicle.has_value();
  const bool has_imu_log = settings.imu && !settings.imu->log.empty();
  if (!has_can && !(options.can + options.can_pipe).empty())
    return fail(options.drive + ": has no CAN log; run without --can and --can-pipe");
  if (!has_imu_log && (!options.imu_pty.empty() || options.imu_udp)) {
    return fail(options.drive + ": has no IMU log; run without --imu-pty and --imu-udp");
  }
  Player::Tracks tracks;
  std::vector<Expected<std::unique_ptr<Track>>> opened;
  opened.push_back(lidar_track(settings.lidar, options));
  if (has_can) opened.push_back(can_track(*settings.vehicle, options));
  if (has_imu_log) opened.push_back(imu_track(*settings.imu, options));
  for (auto& track : opened) {
    if (!track) return tl::make_unexpected(track.error());
    tracks.push_back(std::move(*track));
  }
  return tracks;
}

void wait_for_listeners(const Player::Tracks& tracks, bool quiet) {
  for (const auto& track : tracks) {
    if (!track->has_output() || track->has_listener()) continue;
    if (!quiet) std::printf("waiting until %s is opened by a reader\n", track->destination().c_str());
    std::fflush(stdout);
    constexpr timespec kPause{.tv_sec = 0, .tv_nsec = 20'000'000};
    while (!track->has_listener() && !stop.load()) ::nanosleep(&kPause, nullptr);
  }
}

Expected<PlayReport> play(const ReplayOptions& options) {
  const auto settings = load_drive(options.drive);
  if (!settings) return tl::make_unexpected(settings.error());
  const auto tracks = open_tracks(*settings, options);
  if (!tracks) return tl::make_unexpected(tracks.error());
  if (!options.json) std::fputs(plan_text(options.drive, options.plan, *tracks).c_str(), stdout);
  wait_for_listeners(*tracks, options.json);

  const bool show_progress = ::isatty(STDERR_FILENO) == 1 && !options.json;
  Player player(options.plan, *tracks, stop, [&](const PlayReport& report) {
    if (show_progress) std::fprintf(stderr, "\r%s\033[K", progress_text(report, *tracks).c_str());
  });
  const auto report = player.run();
  if (show_progress) std::fputs("\r\033[K", stderr);
  if (!report) return report;
  const std::string text =
      options.json ? report_json(options.drive, options.plan, *report, *tracks) : report_text(*report, *tracks);
  std::fputs(text.c_str(), stdout);
  return report;
}

}  // namespace

int replay(const ReplayOptions& options) {
  end_on_signals();
  // The default lets every sleep end 50 us late: a fifth of the time between two packets.
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  const auto report = play(options);
  if (report) return 0;
  std::fprintf(stderr, "roadvec-replay: %s\n", report.error().message.c_str());
  return 1;
}

}  // namespace roadvec
