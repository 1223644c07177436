#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/geometry/anchor.h"
#include "daemon/server/pose_report.h"
#include "daemon/server/served_map.h"
#include "daemon/server/session.h"

namespace roadvec {

/// What the daemon can do for its owner. Called by the server's thread; neither waits.
struct OwnerCommands {
  std::function<std::uint64_t()> durable_seq;  ///< newest change that is safe on disk; none: nothing is kept there
  std::function<std::string()> cannot_save;    ///< why nothing can be written to disk at present; empty: it can
  std::function<void()> begin_new_map;         ///< an EpochChange with reason map_replaced says that it is done
};

/// What the server answers, whatever the transport: requests in, frames queued on the session. Server thread only.
class Conversation {
 public:
  struct Facts {
    std::string server_version;
    std::optional<Anchor> anchor;  ///< none: the place on Earth is not known
    OwnerCommands commands;
    /// A batch of changes or tiles is closed when it holds this much: it keeps a socket's buffer full, and is all that
    /// a client that does not read costs beside its cursor.
    std::size_t batch_bytes = std::size_t{64} << 10;
  };
  Conversation(ServedMap& map, Facts facts) : map_(map), facts_(std::move(facts)) {}

  /// Answers one Envelope of the client. A reason: the client must leave.
  [[nodiscard]] std::optional<wire::Bye> answer(Session& session, std::string_view envelope, double now_s);
  /// Queues the next tiles or changes for a client that has nothing waiting; false: it has them all, or wants them
  /// later.
  bool follow(Session& session, double now_s, bool hurry);
  [[nodiscard]] bool caught_up(const Session& session) const;

  /// The newest pose and status, for answers.
  void set_pose(const PoseReport& pose) { pose_ = pose; }
  [[nodiscard]] const std::optional<PoseReport>& pose() const { return pose_; }
  void set_status(wire::Status status);
  [[nodiscard]] const SharedFrame& status_frame() const { return status_frame_; }
  /// Tells a session that awaits the result of its command, once that is there.
  void finish_command(Session& session, double now_s);

  struct Counts {
    std::uint64_t requests = 0;
    std::uint64_t overruns = 0;  ///< clients that lost changes
    std::uint64_t recuts = 0;    ///< tiles that changed before a client had read them
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  using Ending = std::optional<wire::Bye>;
  Ending take(Session& session, const wire::Hello& hello, double now_s);
  Ending take(Session& session, const wire::GetTiles& request, double now_s);
  Ending take(Session& session, const wire::Subscribe& request, double now_s);
  Ending take(Session& session, const wire::GetStatus& request, double now_s);
  Ending take(Session& session, const wire::GetMetrics& request, double now_s);
  Ending take(Session& session, const wire::Ping& ping, double now_s);
  Ending take(Session& session, const wire::Command& command, double now_s);
  Ending take(Session& session, const auto& other, double now_s);

  template <class M>
  void reply(Session& session, const M& message, double now_s) {
    session.queue(map_.encoder().encode(message), now_s);
  }
  void refuse(Session& session, wire::Error::Code code, std::string text, double now_s) {
    reply(session, wire::Error{code, std::move(text)}, now_s);
  }
  void choose(Session::Delivery& delivery, const std::vector<wire::KnownTile>& known, std::uint64_t known_epoch) const;
  void recut(Session::Delivery& delivery) const;
  void sort(std::vector<TileKey>& keys) const;
  void snapshot(Session& session, const wire::Subscribe& request, double now_s);
  void overrun(Session& session, double now_s);
  void announce_lost(Session& session, double now_s);
  void deliver_snapshot(Session& session, double now_s);
  void deliver_answer(Session& session, double now_s);
  [[nodiscard]] SharedFrame in_area(const SharedFrame& change, const std::optional<wire::Area>& area);

  ServedMap& map_;
  Facts facts_;
  std::optional<PoseReport> pose_;
  wire::Status status_;
  SharedFrame status_frame_;
  Counts counts_;
};

}  // namespace roadvec
