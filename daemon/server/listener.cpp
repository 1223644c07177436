#include "daemon/server/listener.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>

namespace roadvec {
namespace {

[[noreturn]] void fail_to_listen(const std::string& path, const std::string& what) {
  throw std::runtime_error("socket " + path + ": " + what);
}

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    fail_to_listen(path, "a socket path has 1 to " + std::to_string(sizeof address.sun_path - 1) + " bytes");
  }
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

FileDescriptor new_socket() {
  FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (socket.get() < 0) throw std::system_error(errno, std::generic_category(), "UNIX socket");
  return socket;
}

/// Connecting is the only way to tell a live daemon from a file that a killed one left behind.
void remove_if_stale(const std::string& path, const sockaddr_un& address) {
  struct stat found {};
  if (::lstat(path.c_str(), &found) != 0) return;
  if (!S_ISSOCK(found.st_mode))
    fail_to_listen(path, "a file that is not a socket is in the way; remove it or configure another path");
  const FileDescriptor probe = new_socket();
  if (::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ||
      errno != ECONNREFUSED) {
    fail_to_listen(path, "in use by another process; stop the other roadvecd or configure another path");
  }
  ::unlink(path.c_str());
}

}  // namespace

Listener::Listener(const std::string& path, mode_t mode, int adopted_fd) : socket_(adopted_fd) {
  if (adopted_fd < 0) {
    const sockaddr_un address = address_of(path);
    remove_if_stale(path, address);
    socket_ = new_socket();
    if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      fail_to_listen(path,
                     std::string("bind: ") + std::strerror(errno) + "; does the folder exist and may we write to it?");
    }
    owned_path_ = path;
    struct stat made {};
    // The mode is set before listen(): until then nobody can connect.
    if (::chmod(path.c_str(), mode) != 0 || ::stat(path.c_str(), &made) != 0 ||
        ::listen(socket_.get(), SOMAXCONN) != 0) {
      fail_to_listen(path, std::strerror(errno));
    }
    device_ = made.st_dev;
    inode_ = made.st_ino;
  } else if (const int flags = ::fcntl(adopted_fd, F_GETFL);
             flags < 0 || ::fcntl(adopted_fd, F_SETFL, flags | O_NONBLOCK) != 0) {
    fail_to_listen("fd " + std::to_string(adopted_fd), std::string("handed over, but ") + std::strerror(errno));
  }
}

void Listener::give_to(gid_t group) const {
  if (::chown(owned_path_.c_str(), static_cast<uid_t>(-1), group) != 0) {
    fail_to_listen(owned_path_, std::string("cannot give it to its group: ") + std::strerror(errno) +
                                    "; is the daemon's user a member of the group?");
  }
}

FileDescriptor Listener::accept() const {
  return FileDescriptor(::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
}

void Listener::close() {
  struct stat found {};
  const bool ours = !owned_path_.empty() && ::stat(owned_path_.c_str(), &found) == 0 && found.st_dev == device_ &&
                    found.st_ino == inode_;
  if (ours) ::unlink(owned_path_.c_str());
  owned_path_.clear();
  socket_ = FileDescriptor();
}

}  // namespace roadvec
