#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "core/wire/codec.h"
#include "core/wire/frame_assembler.h"
#include "daemon/server/file_descriptor.h"

namespace roadvec {

/// The client's end of the map socket: blocking, one thread. Used by `roadvec` and by tests.
class MapClient {
 public:
  using Seconds = std::chrono::duration<double>;

  /// Connects and exchanges Hello and Welcome. The error says what to do when no daemon answers.
  [[nodiscard]] static Expected<MapClient> connect(const std::string& socket_path, const std::string& client_name,
                                                   Seconds timeout);
  /// A connection without the greeting.
  [[nodiscard]] static Expected<MapClient> open(const std::string& socket_path);

  [[nodiscard]] const wire::Welcome& welcome() const { return welcome_; }
  [[nodiscard]] int fd() const { return socket_.get(); }

  template <class M>
  [[nodiscard]] Expected<void> send(const M& message) {
    return send_bytes(wire::encode_frame(message, buffer_));
  }
  [[nodiscard]] Expected<void> send_bytes(std::string_view bytes);

  /// The next message. Fails when the timeout passes, the server is gone (without Bye) or sends what cannot be read.
  [[nodiscard]] Expected<wire::Message> receive(Seconds timeout);
  /// The next message of one kind, passing over others; fails on Bye and on Error.
  template <class M>
  [[nodiscard]] Expected<M> receive_one(Seconds timeout) {
    const auto until = std::chrono::steady_clock::now() + timeout;
    while (true) {
      Expected<wire::Message> message = receive(until - std::chrono::steady_clock::now());
      if (!message) return tl::unexpected<Error>(message.error());
      if (auto* wanted = std::get_if<M>(&*message)) return std::move(*wanted);
      if (const auto* bye = std::get_if<wire::Bye>(&*message))
        return fail("the daemon closed the connection: " + bye->text);
      if (const auto* error = std::get_if<wire::Error>(&*message)) return fail("the daemon answered: " + error->text);
    }
  }

 private:
  explicit MapClient(FileDescriptor socket);

  FileDescriptor socket_;
  wire::FrameAssembler input_;
  std::vector<char> buffer_;
  wire::Welcome welcome_;
};

}  // namespace roadvec
