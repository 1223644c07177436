#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/geometry/anchor.h"
#include "daemon/server/pose_report.h"
#include "daemon/server/served_map.h"
#include "daemon/server/session.h"

namespace roadvec {

/// What the server answers, whatever the transport: requests in, frames queued on the session. Server thread only.
class Conversation {
 public:
  struct Facts {
    std::string server_version;
    std::optional<Anchor> anchor;  ///< none: the place on Earth is not known
  };
  Conversation(ServedMap& map, Facts facts) : map_(map), facts_(std::move(facts)) {}

  /// Answers one Envelope of the client. A reason: the client must leave.
  [[nodiscard]] std::optional<wire::Bye> answer(Session& session, std::string_view envelope, double now_s);
  /// Queues the next changes for a subscriber that has nothing waiting; false: it has them all, or wants them later.
  bool follow(Session& session, double now_s, bool hurry);
  [[nodiscard]] bool caught_up(const Session& session) const;

  /// The newest pose and status, for answers.
  void set_pose(const PoseReport& pose) { pose_ = pose; }
  void set_status(SharedFrame status) { status_ = std::move(status); }
  [[nodiscard]] std::uint64_t overrun_count() const { return overrun_count_; }
  [[nodiscard]] std::uint64_t request_count() const { return request_count_; }

 private:
  using Ending = std::optional<wire::Bye>;
  Ending take(Session& session, const wire::Hello& hello, double now_s);
  Ending take(Session& session, const wire::GetTiles& request, double now_s);
  Ending take(Session& session, const wire::Subscribe& request, double now_s);
  Ending take(Session& session, const wire::GetStatus& request, double now_s);
  Ending take(Session& session, const wire::Ping& ping, double now_s);
  Ending take(Session& session, const auto& other, double now_s);

  template <class M>
  void reply(Session& session, const M& message, double now_s) {
    session.queue(map_.encoder().encode(message), now_s);
  }
  std::vector<TileKey> chosen(const wire::GetTiles& request, const Pose2& T_map_vehicle) const;
  void snapshot(Session& session, const wire::Subscribe& request, double now_s);
  void overrun(Session& session, double now_s);
  void end_snapshot(Session& session, const std::vector<TileKey>& keys, double now_s);
  [[nodiscard]] SharedFrame in_area(const SharedFrame& change, const std::optional<wire::Area>& area);

  ServedMap& map_;
  Facts facts_;
  std::optional<PoseReport> pose_;
  SharedFrame status_;
  std::uint64_t overrun_count_ = 0, request_count_ = 0;
};

}  // namespace roadvec
