#pragma once

#include <sys/types.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <map>

#include "core/wire/messages.h"

namespace roadvec {

/// Counts since start; any thread may read.
struct ServerCounters {
  std::atomic<std::uint64_t> connected_count{0}, requests_count{0}, frames_sent_count{0}, bytes_sent_count{0};
  std::atomic<std::uint64_t> overruns_count{0}, recuts_count{0}, poses_skipped_count{0}, accept_errors_count{0};
  /// By the reason in our Bye; `unspecified`: the client left by itself.
  std::array<std::atomic<std::uint64_t>, static_cast<std::size_t>(wire::Bye::Reason::not_authorised) + 1>
      closed_count{};
};
/// `clients_of_user`: how many each user has connected, by its number; `waiting_bytes`: what they have all still to
/// take.
[[nodiscard]] wire::Stage stage_of(const ServerCounters& counters, const std::map<uid_t, std::size_t>& clients_of_user,
                                   std::size_t waiting_bytes);

}  // namespace roadvec
