#include "daemon/server/map_server.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace roadvec {
namespace {

using Reason = wire::Bye::Reason;

/// Requests answered for one client before the others have their turn.
constexpr int kMostTurns = 32;
constexpr double kPoseTick_s = 0.01, kOrdinaryTick_s = 0.25;
constexpr double kCrowded_s = 3;       // how long the status says so
constexpr int kMostToldPerSecond = 5;  // of dismissed clients; the rest is counted

double steady_now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void add(std::atomic<std::uint64_t>& counter, std::uint64_t count) {
  counter.fetch_add(count, std::memory_order_relaxed);
}

}  // namespace

MapServer::MapServer(const MapServerConfig& config, FrameLog& log, Latest<PoseReport>& poses, StatusProvider status)
    : config_(config),
      poses_(poses),
      status_provider_(std::move(status)),
      listener_(config.socket_path, config.socket_mode, config.adopted_fd),
      map_(log, config.start),
      conversation_(map_, config.facts) {
  if (!config.control_path.empty() || config.control_fd >= 0)
    control_listener_.emplace(config.control_path, 0600, config.control_fd);
  if (config.group.empty()) return;
  const Expected<gid_t> group = group_of(config.group);
  if (!group) throw std::runtime_error("server.group: " + group.error().message);
  group_ = *group;
  if (config.adopted_fd < 0) listener_.give_to(*group);
}

bool MapServer::run(std::stop_token stop) {
  const std::stop_callback wake(stop, [this] { map_.reader().ring(); });
  while (true) {
    wait(steady_now_s());
    const double now_s = steady_now_s();
    const bool stopping = stop.stop_requested();  // before take_new(): what was published before the stop is sent
    if (map_.take_new() == ServedMap::Taken::lost) {
      for (Session& session : sessions_) {
        dismiss(session, {Reason::map_lost, "the server was overrun by its own log"}, now_s);
        (void)session.send(now_s);
      }
      close_listeners();
      return false;
    }
    if (config_.on_written && written_seq_ < map_.head().seq && !is_followed())
      config_.on_written(written_seq_ = map_.head().seq, false);
    if (now_s >= next_second_s_) every_second(now_s);
    std::size_t i = 0;
    work_is_left_ = false;
    for (Session& session : sessions_) serve(session, events_[i++], now_s);
    if (poses_.fresh()) send_pose(now_s);
    close_finished();
    if (stopping && !leaving_) begin_farewell(now_s);
    if (leaving_ && (sessions_.empty() || now_s > farewell_until_s_)) return true;
    if (!leaving_ && client_waits_) accept_clients(listener_, false, now_s);
    if (!leaving_ && owner_waits_) accept_clients(*control_listener_, true, now_s);
  }
}

void MapServer::wait(double now_s) {
  std::vector<pollfd> polled;
  polled.push_back({map_.reader().doorbell(), POLLIN, 0});
  const bool accepting = !leaving_ && now_s >= accept_again_s_;
  polled.push_back({accepting ? listener_.fd() : -1, POLLIN, 0});
  polled.push_back({accepting && control_listener_ ? control_listener_->fd() : -1, POLLIN, 0});
  for (const Session& session : sessions_) {
    polled.push_back({session.fd(),
                      static_cast<short>(session.has_output()    ? POLLOUT
                                         : session.wants_input() ? POLLIN
                                                                 : 0),
                      0});
  }
  ::poll(polled.data(), polled.size(), static_cast<int>(std::ceil(tick_s(now_s) * 1000)));
  client_waits_ = polled[1].revents != 0;
  owner_waits_ = polled[2].revents != 0;
  events_.clear();
  for (std::size_t i = 3; i < polled.size(); ++i) events_.push_back(polled[i].revents);
}

/// How long nothing happens unless a descriptor says so.
double MapServer::tick_s(double now_s) const {
  if (work_is_left_) return 0;
  double tick_s = wants_poses() || leaving_ ? kPoseTick_s : kOrdinaryTick_s;
  for (const Session& session : sessions_) {
    if (session.awaited) tick_s = std::min(tick_s, kPoseTick_s);
    // In the middle of a change its next frame rings the bell.
    if (session.following && !session.has_output() && !conversation_.caught_up(session) && map_.replica().consistent())
      tick_s = std::min(tick_s, std::max(0.0, session.following->next_changes_s - now_s));
  }
  return tick_s;
}

void MapServer::accept_clients(const Listener& listener, bool as_owner, double now_s) {
  for (int turn = 0; turn < kMostTurns; ++turn) {
    FileDescriptor socket = listener.accept();
    if (socket.get() < 0) {
      if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ECONNABORTED) return;
      // Out of descriptors or memory: the connection stays in the queue and would wake us at once, so try again a
      // little later.
      add(counters_.accept_errors_count, 1);
      accept_again_s_ = now_s + 1;
      crowded_until_s_ = now_s + kCrowded_s;
      return;
    }
    add(counters_.connected_count, 1);
    if (config_.send_buffer_bytes > 0) {
      ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDBUF, &config_.send_buffer_bytes, sizeof config_.send_buffer_bytes);
    }
    Peer peer = peer_of(socket.get());
    Session& session = sessions_.emplace_back(std::move(socket), std::move(peer), now_s);
    session.is_owner = as_owner;
    if (const auto bye = refusal(session)) {
      if (bye->reason == Reason::too_many_clients) crowded_until_s_ = now_s + kCrowded_s;
      dismiss(session, *bye, now_s);
      if (!session.send(now_s) || !session.has_output() || sessions_.size() > 2 * config_.most_clients)
        sessions_.pop_back();
    }
  }
}

/// Why the newest session may not stay.
std::optional<wire::Bye> MapServer::refusal(const Session& newcomer) const {
  if (!Gate{::geteuid(), group_, newcomer.is_owner}.admits(newcomer.peer())) {
    return wire::Bye{Reason::not_authorised, newcomer.is_owner
                                                 ? "commands are for the daemon's own user and root"
                                                 : "the map is for members of the group " + config_.group};
  }
  std::size_t all = 0, of_user = 0;
  for (const Session& session : sessions_) {
    if (session.state == Session::State::leaving || session.is_owner != newcomer.is_owner) continue;
    ++all;
    of_user += session.peer().uid == newcomer.peer().uid ? 1 : 0;
  }
  const std::size_t most = newcomer.is_owner ? config_.most_owner_clients : config_.most_clients;
  if (all > most) return wire::Bye{Reason::too_many_clients, "at most " + std::to_string(most) + " clients"};
  if (!newcomer.is_owner && of_user > config_.most_clients_per_user) {
    return wire::Bye{Reason::too_many_clients,
                     "at most " + std::to_string(config_.most_clients_per_user) + " clients of one user"};
  }
  return std::nullopt;
}

void MapServer::every_second(double now_s) {
  next_second_s_ = now_s + 1;
  told_count_ = 0;
  if (poses_.fresh()) conversation_.set_pose(poses_.load());
  wire::Status status = status_provider_();
  status.server_version = config_.facts.server_version;
  status.epoch = map_.head().epoch;
  status.head_seq = map_.head().seq;
  status.tile_count = map_.replica().tiles().size();
  std::map<uid_t, std::size_t> clients_of_user;
  std::size_t waiting_bytes = 0;
  for (const Session& session : sessions_) {
    ++clients_of_user[session.peer().uid];
    waiting_bytes += session.waiting_bytes();
  }
  if (conversation_.pose()) status.pose = pose_of(*conversation_.pose());
  wire::Stage stage = stage_of(counters_, clients_of_user, waiting_bytes);
  if (now_s < crowded_until_s_) {
    stage.state = "crowded";
    stage.detail = "clients are turned away: server.most_clients, server.most_clients_per_user; the log names them";
    if (status.state == "mapping") status.state = "degraded";
  }
  status.stages.push_back(std::move(stage));
  conversation_.set_status(std::move(status));
  const SharedFrame heartbeat = map_.encoder().encode(wire::Heartbeat{map_.head().epoch, map_.head().seq});
  for (Session& session : sessions_) {
    if (session.state != Session::State::greeted || session.has_output()) continue;
    session.queue(heartbeat, now_s);
    if (session.following && session.following->status) session.queue(conversation_.status_frame(), now_s);
  }
}

bool MapServer::is_followed() const {
  return std::ranges::any_of(sessions_, [](const Session& s) { return s.following.has_value(); });
}

wire::Pose MapServer::pose_of(const PoseReport& report) const {
  return {report.time,           map_.head().epoch,           map_.replica().T_map_odom() * report.T_odom_vehicle,
          report.T_odom_vehicle, map_.replica().T_map_odom(), report.covariance,
          report.speed_mps,      report.yaw_rate_radps};
}

bool MapServer::wants_poses() const {
  return std::ranges::any_of(sessions_, [](const Session& s) { return s.following && s.following->poses; });
}

void MapServer::send_pose(double now_s) {
  const PoseReport& report = poses_.load();
  conversation_.set_pose(report);
  if (!wants_poses()) return;
  const SharedFrame frame = map_.encoder().encode(pose_of(report));
  for (Session& session : sessions_) {
    if (!session.following || !session.following->poses || now_s < session.following->next_pose_s) continue;
    if (session.has_output()) {
      add(counters_.poses_skipped_count, 1);
      continue;
    }
    session.following->next_pose_s = now_s + session.following->interval_s;
    session.queue(frame, now_s);
    if (!session.send(now_s)) close_left(session, now_s);
    count_sent(session);
  }
}

void MapServer::serve(Session& session, short events, double now_s) {
  if ((events & (POLLIN | POLLHUP | POLLERR)) != 0 && !session.has_output() && !session.receive(now_s)) {
    // What had come before it left is still answered, as far as it can be read: a client may ask and shut down its
    // side.
    advance(session, now_s);
    if (session.state != Session::State::leaving) add(counters_.closed_count[0], 1);
    session.enter(Session::State::closed, now_s);
    return;
  }
  advance(session, now_s);
  enforce_time_limits(session, now_s);
}

void MapServer::advance(Session& session, double now_s) {
  using State = Session::State;
  for (int turn = 0; turn < kMostTurns; ++turn) {
    if (!session.send(now_s)) close_left(session, now_s);
    count_sent(session);
    if (session.has_output() || session.state == State::closed) return;
    note_written(session);
    if (session.state == State::leaving) return session.enter(State::closed, now_s);
    if (leaving_ && conversation_.caught_up(session)) {
      dismiss(session, {Reason::shutdown, "roadvecd stops"}, now_s);
      continue;
    }
    conversation_.finish_command(session, now_s);
    // In the middle of a change in several frames nothing is answered: a snapshot would show half of it.
    const bool busy = leaving_ || session.delivery || session.awaited || !map_.replica().consistent();
    const auto envelope = busy ? std::nullopt : session.input().next();
    if (envelope) {
      session.frame_taken(now_s);
      if (const auto bye = conversation_.answer(session, *envelope, now_s)) dismiss(session, *bye, now_s);
    } else if (!busy && session.input().wrong_length()) {
      dismiss(session, {Reason::frame_length, "a frame of 0 bytes, or of more than 1 MiB"}, now_s);
    } else if (!conversation_.follow(session, now_s, leaving_)) {
      return;
    }
  }
  work_is_left_ = true;
}

void MapServer::enforce_time_limits(Session& session, double now_s) {
  using State = Session::State;
  if (session.state == State::closed) return;
  if (session.state == State::awaiting_hello && now_s - session.since_s() > config_.hello_timeout_s) {
    dismiss(session, {Reason::hello_timeout, "no Hello in time"}, now_s);
  } else if (session.state != State::leaving && session.half_frame(now_s, config_.half_frame_timeout_s)) {
    dismiss(session, {Reason::frame_timeout, "half a frame"}, now_s);
  } else if (session.state != State::leaving && session.stalled(now_s, config_.stall_timeout_s)) {
    dismiss(session, {Reason::stalled, "not reading"}, now_s);
  } else if (session.state == State::leaving && now_s - session.since_s() > config_.farewell_s) {
    session.enter(State::closed, now_s);
  } else {
    return;
  }
  if (session.state == State::leaving) advance(session, now_s);
}

void MapServer::dismiss(Session& session, const wire::Bye& bye, double now_s) {
  if (session.state == Session::State::leaving || session.state == Session::State::closed) return;
  add(counters_.closed_count[static_cast<std::size_t>(bye.reason)], 1);
  tell_of(session, bye);
  session.leave(map_.encoder().encode(bye), now_s);
}

void MapServer::tell_of(const Session& session, const wire::Bye& bye) {
  if (!config_.log || bye.reason == Reason::shutdown || ++told_count_ > kMostToldPerSecond) return;
  const std::string more = told_count_ == kMostToldPerSecond ? " (more of this second are only counted)" : "";
  config_.log("client of uid " + std::to_string(session.peer().uid) + ", pid " + std::to_string(session.peer().pid) +
              " dismissed: " + bye.text + more);
}

/// Nothing waits in the session: the kernel has all that was meant for it.
void MapServer::note_written(const Session& session) {
  if (!config_.on_written || !session.following || session.delivery || session.following->seq <= written_seq_) return;
  config_.on_written(written_seq_ = session.following->seq, true);
}

void MapServer::close_left(Session& session, double now_s) {
  if (session.state != Session::State::leaving && session.state != Session::State::closed)
    add(counters_.closed_count[0], 1);
  session.enter(Session::State::closed, now_s);
}

void MapServer::close_listeners() {
  listener_.close();
  if (control_listener_) control_listener_->close();
}

void MapServer::begin_farewell(double now_s) {
  leaving_ = true;
  farewell_until_s_ = now_s + config_.farewell_s;
  close_listeners();
  for (Session& session : sessions_) {
    if (session.state == Session::State::awaiting_hello) dismiss(session, {Reason::shutdown, "roadvecd stops"}, now_s);
  }
  work_is_left_ = true;
}

void MapServer::count_sent(Session& session) {
  add(counters_.frames_sent_count, std::exchange(session.sent_frames, 0));
  add(counters_.bytes_sent_count, std::exchange(session.sent_bytes, 0));
}

void MapServer::close_finished() {
  std::erase_if(sessions_, [](const Session& session) { return session.state == Session::State::closed; });
  const Conversation::Counts& counts = conversation_.counts();
  counters_.requests_count.store(counts.requests, std::memory_order_relaxed);
  counters_.overruns_count.store(counts.overruns, std::memory_order_relaxed);
  counters_.recuts_count.store(counts.recuts, std::memory_order_relaxed);
}

}  // namespace roadvec
