#pragma once

#include <functional>
#include <list>
#include <map>
#include <stop_token>

#include "core/ring/latest.h"
#include "daemon/server/conversation.h"
#include "daemon/server/listener.h"
#include "daemon/server/server_counters.h"

namespace roadvec {

struct MapServerConfig {
  std::string socket_path;
  unsigned socket_mode = 0660;  ///< who may connect: owner and group
  int adopted_fd = -1;          ///< a listening socket from systemd, in place of the path
  std::string group;            ///< whose members may connect, beside owner and root; empty: whom the mode lets
  std::string control_path;     ///< socket that takes commands, for owner and root; empty: none
  int control_fd = -1;          ///< as adopted_fd
  MapHead start;                ///< the same as the MapPublisher's
  Conversation::Facts facts;
  std::size_t most_clients = 64, most_clients_per_user = 16, most_owner_clients = 4;
  int send_buffer_bytes = 0;  ///< what the kernel keeps for a client that does not read; 0: the system's own
  /// Called by the server's thread when a client that follows has taken every change up to `seq`, or, with false, when
  /// nobody follows and they concern nobody.
  std::function<void(std::uint64_t seq, bool taken)> on_written;
  std::function<void(const std::string&)> log;  ///< a line about a client that was dismissed
  double hello_timeout_s = 5, stall_timeout_s = 10, half_frame_timeout_s = 10, farewell_s = 2;
};

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
  [[nodiscard]] double tick_s(double now_s) const;
  void accept_clients(const Listener& listener, bool as_owner, double now_s);
  [[nodiscard]] std::optional<wire::Bye> refusal(const Session& newcomer) const;
  void every_second(double now_s);
  void send_pose(double now_s);
  void serve(Session& session, short events, double now_s);
  void advance(Session& session, double now_s);
  void enforce_time_limits(Session& session, double now_s);
  void dismiss(Session& session, const wire::Bye& bye, double now_s);
  void close_left(Session& session, double now_s);
  void close_listeners();
  void begin_farewell(double now_s);
  void close_finished();
  void count_sent(Session& session);
  void note_written(const Session& session);
  void tell_of(const Session& session, const wire::Bye& bye);
  [[nodiscard]] wire::Pose pose_of(const PoseReport& report) const;
  [[nodiscard]] bool wants_poses() const;
  [[nodiscard]] bool is_followed() const;

  MapServerConfig config_;
  Latest<PoseReport>& poses_;
  StatusProvider status_provider_;
  Listener listener_;
  std::optional<Listener> control_listener_;
  std::optional<gid_t> group_;
  ServedMap map_;
  Conversation conversation_;
  std::list<Session> sessions_;
  std::vector<short> events_;  ///< of poll, one per session in the same order
  ServerCounters counters_;
  bool client_waits_ = false, owner_waits_ = false, work_is_left_ = false, leaving_ = false;
  double accept_again_s_ = 0, next_second_s_ = 0, farewell_until_s_ = 0, crowded_until_s_ = 0;
  std::uint64_t written_seq_ = 0;  ///< on_written was told
  int told_count_ = 0;             ///< lines for the log since the last second
};

}  // namespace roadvec
