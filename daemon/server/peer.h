#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace roadvec {

/// Who is at the other end of a UNIX socket, as it was when it connected [unix(7), SO_PEERCRED, SO_PEERGROUPS].
struct Peer {
  uid_t uid = static_cast<uid_t>(-1);  ///< that of nobody: of a peer that the kernel does not know
  gid_t gid = static_cast<gid_t>(-1);
  std::vector<gid_t> groups;  ///< supplementary ones
  pid_t pid = 0;              ///< 0: of another PID namespace, or not known

  [[nodiscard]] bool in_group(gid_t group) const;
  /// The user that the daemon runs as, or root.
  [[nodiscard]] bool is_owner(uid_t daemon_uid) const { return uid == daemon_uid || uid == 0; }
};
[[nodiscard]] Peer peer_of(int connected_socket);

/// Who may use a socket, once its file mode has let him through.
struct Gate {
  uid_t daemon_uid;
  std::optional<gid_t> group;  ///< whose members may, beside the owner; none: everybody
  bool owner_only = false;
  [[nodiscard]] bool admits(const Peer& peer) const {
    return peer.is_owner(daemon_uid) || (!owner_only && (!group || peer.in_group(*group)));
  }
};

/// The number of a group; the error says what to do.
[[nodiscard]] Expected<gid_t> group_of(const std::string& name);

}  // namespace roadvec
