#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <list>
#include <stop_token>

#include "core/ring/latest.h"
#include "daemon/server/conversation.h"
#include "daemon/server/listener.h"

namespace roadvec {

struct MapServerConfig {
  std::string socket_path;
  unsigned socket_mode = 0660;  ///< who may connect: owner and group
  int adopted_fd = -1;          ///< a listening socket from systemd, in place of the path
  MapHead start;                ///< the same as the MapPublisher's
  Conversation::Facts facts;
  std::size_t most_clients = 64;
  double hello_timeout_s = 5, stall_timeout_s = 10, half_frame_timeout_s = 10, farewell_s = 2;
};

/// Counts since start; any thread may read.
struct ServerCounters {
  std::atomic<std::uint64_t> connected_count{0}, requests_count{0}, frames_sent_count{0}, bytes_sent_count{0};
  std::atomic<std::uint64_t> overruns_count{0}, poses_skipped_count{0}, accept_errors_count{0};
  /// By the reason in our Bye; `unspecified`: the client left by itself.
  std::array<std::atomic<std::uint64_t>, static_cast<std::size_t>(wire::Bye::Reason::map_lost) + 1> closed_count{};
};
[[nodiscard]] wire::Stage stage_of(const ServerCounters& counters, std::size_t client_count);

/// Serves the map on a UNIX socket: one ordinary thread, poll(). A client costs a cursor into the log and the frames it
/// has not yet taken; none can make another, or the optimiser, wait. The conversation and its limits are described in
/// core/wire/roadvec.proto.
///
///   log   written by MapPublisher in the optimiser thread; this registers as one of its readers
///   poses written by the mapping thread; looked at every 10 ms while somebody asked for poses, so that the writer
///   needs no system call status called once a second in the server's thread; the server adds a stage of its own
class MapServer {
 public:
  using StatusProvider = std::function<wire::Status()>;
  /// Listens from here on; throws when it cannot. Construct before the log's writer starts.
  MapServer(const MapServerConfig& config, FrameLog& log, Latest<PoseReport>& poses, StatusProvider status);

  /// Serves until stop is requested; then sends what has been published, says Bye to everybody (within farewell_s) and
  /// removes the socket. false: it lost the map because the log overran it (cannot happen while the writer asks
  /// has_room()): restart the daemon.
  [[nodiscard]] bool run(std::stop_token stop);

  [[nodiscard]] const ServerCounters& counters() const { return counters_; }

 private:
  void wait(double now_s);
  void accept_clients(double now_s);
  void every_second(double now_s);
  void send_pose(double now_s);
  void serve(Session& session, short events, double now_s);
  void advance(Session& session, double now_s);
  void enforce_time_limits(Session& session, double now_s);
  void dismiss(Session& session, const wire::Bye& bye, double now_s);
  void close_left(Session& session, double now_s);
  void begin_farewell(double now_s);
  void close_finished();
  void count_sent(Session& session);
  [[nodiscard]] bool wants_poses() const;

  MapServerConfig config_;
  Latest<PoseReport>& poses_;
  StatusProvider status_provider_;
  Listener listener_;
  ServedMap map_;
  Conversation conversation_;
  std::list<Session> sessions_;
  std::vector<short> events_;  ///< of poll, one per session in the same order
  ServerCounters counters_;
  bool client_waits_ = false, work_is_left_ = false, leaving_ = false;
  double accept_again_s_ = 0, next_second_s_ = 0, farewell_until_s_ = 0;
};

}  // namespace roadvec
