#include "daemon/server/peer.h"

#include <grp.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>

namespace roadvec {
namespace {

std::vector<gid_t> groups_of(int connected_socket) {
  std::vector<gid_t> groups(32);
  while (true) {
    auto bytes = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
    const int result = ::getsockopt(connected_socket, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &bytes);
    if (result != 0 && errno != ERANGE) return {};
    groups.resize(bytes / sizeof(gid_t));  // ERANGE: how many there are
    if (result == 0) return groups;
  }
}

}  // namespace

bool Peer::in_group(gid_t group) const { return gid == group || std::ranges::find(groups, group) != groups.end(); }

Peer peer_of(int connected_socket) {
  ucred credentials{};
  socklen_t bytes = sizeof credentials;
  if (::getsockopt(connected_socket, SOL_SOCKET, SO_PEERCRED, &credentials, &bytes) != 0) return {};
  return {credentials.uid, credentials.gid, groups_of(connected_socket), credentials.pid};
}

Expected<gid_t> group_of(const std::string& name) {
  std::vector<char> buffer(std::size_t{1} << 16);
  group entry{};
  group* found = nullptr;
  if (::getgrnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr) {
    return fail("there is no group '" + name + "': addgroup --system " + name + ", or name another one");
  }
  return found->gr_gid;
}

}  // namespace roadvec
