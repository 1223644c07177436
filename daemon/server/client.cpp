#include "daemon/server/client.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace roadvec {

MapClient::MapClient(FileDescriptor socket)
    : socket_(std::move(socket)),
      input_(wire::kMostServerBytes),
      buffer_(wire::kMostClientBytes + wire::kFrameHeaderBytes) {}

Expected<MapClient> MapClient::open(const std::string& socket_path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket_path.empty() || socket_path.size() >= sizeof address.sun_path)
    return fail("socket path " + socket_path + " is too long");
  std::memcpy(address.sun_path, socket_path.data(), socket_path.size());
  FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (socket.get() < 0 || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const std::string hint = errno == EACCES ? "; are you in the socket's group?" : "; is roadvecd running?";
    return fail("cannot connect to " + socket_path + ": " + std::strerror(errno) + hint);
  }
  return MapClient(std::move(socket));
}

Expected<MapClient> MapClient::connect(const std::string& socket_path, const std::string& client_name,
                                       Seconds timeout) {
  Expected<MapClient> client = open(socket_path);
  if (!client) return client;
  wire::Hello hello;
  hello.client_name = client_name;
  if (auto sent = client->send(hello); !sent) return tl::unexpected<Error>(sent.error());
  Expected<wire::Welcome> welcome = client->receive_one<wire::Welcome>(timeout);
  if (!welcome) return fail(socket_path + ": " + welcome.error().message);
  client->welcome_ = *welcome;
  return client;
}

Expected<void> MapClient::send_bytes(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return fail(std::string("cannot send to the daemon: ") + std::strerror(errno));
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return {};
}

Expected<wire::Message> MapClient::receive(Seconds timeout) {
  const auto until = std::chrono::steady_clock::now() + timeout;
  while (true) {
    if (const auto envelope = input_.next()) return wire::decode_envelope(*envelope, wire::Sender::server);
    if (input_.wrong_length()) return fail("the daemon sent a frame of impossible length");
    const double left_s = Seconds(until - std::chrono::steady_clock::now()).count();
    pollfd polled{socket_.get(), POLLIN, 0};
    const int ready = ::poll(&polled, 1, static_cast<int>(std::ceil(std::clamp(left_s, 0.0, 1e6) * 1000)));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return fail("no answer from the daemon in time");
    const std::span<char> space = input_.space();
    const ssize_t count = ::recv(socket_.get(), space.data(), space.size(), 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return fail("the daemon closed the connection");
    input_.received(static_cast<std::size_t>(count));
  }
}

}  // namespace roadvec
