#pragma once

#include <sys/types.h>

#include <string>

#include "daemon/server/file_descriptor.h"

namespace roadvec {

/// The listening UNIX stream socket.
class Listener {
 public:
  /// Binds the path and sets its file mode, which decides who may connect. A socket file that nobody listens on is
  /// replaced; one in use, or a file of another kind, throws. With adopted_fd >= 0 (socket activation) that socket is
  /// used and the path belongs to its giver.
  Listener(const std::string& path, mode_t mode, int adopted_fd);
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  ~Listener() { close(); }

  [[nodiscard]] int fd() const { return socket_.get(); }
  /// Lets a group use the socket file that we have made, as far as its mode says. Throws when we may not.
  void give_to(gid_t group) const;
  /// A new connection, non-blocking; get() < 0 when there is none or errno says why.
  [[nodiscard]] FileDescriptor accept() const;
  /// Stops listening and removes the socket file if it is still ours.
  void close();

 private:
  FileDescriptor socket_;
  std::string owned_path_;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace roadvec
