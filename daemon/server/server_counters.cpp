#include "daemon/server/server_counters.h"

namespace roadvec {

wire::Stage stage_of(const ServerCounters& counters, const std::map<uid_t, std::size_t>& clients_of_user,
                     std::size_t waiting_bytes) {
  static constexpr std::array<const char*, std::tuple_size_v<decltype(ServerCounters::closed_count)>> kClosed = {
      "closed_by_client", "closed_shutdown",     "closed_protocol_version", "closed_hello_timeout",
      "closed_malformed", "closed_frame_length", "closed_frame_timeout",    "closed_stalled",
      "closed_too_many",  "closed_unexpected",   "closed_map_lost",         "closed_not_authorised"};
  wire::Stage stage;
  stage.name = "server";
  stage.state = "ok";
  const auto count = [&](const char* name, const std::atomic<std::uint64_t>& value) {
    stage.counters.push_back({name, value.load(std::memory_order_relaxed)});
  };
  count("clients_connected", counters.connected_count);
  count("requests", counters.requests_count);
  count("frames_sent", counters.frames_sent_count);
  count("bytes_sent", counters.bytes_sent_count);
  count("clients_overrun", counters.overruns_count);
  count("snapshots_recut", counters.recuts_count);
  count("poses_skipped", counters.poses_skipped_count);
  count("accept_errors", counters.accept_errors_count);
  for (std::size_t i = 0; i < kClosed.size(); ++i) count(kClosed[i], counters.closed_count[i]);
  std::size_t client_count = 0;
  for (const auto& [uid, clients] : clients_of_user) client_count += clients;
  stage.gauges.push_back({"clients", static_cast<double>(client_count)});
  stage.gauges.push_back({"waiting_bytes", static_cast<double>(waiting_bytes)});
  for (const auto& [uid, clients] : clients_of_user)
    stage.gauges.push_back({"clients_of_uid_" + std::to_string(uid), static_cast<double>(clients)});
  return stage;
}

}  // namespace roadvec
