#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

#include "daemon/server/conversation.h"

namespace {

using namespace roadvec;

/// A server with a small map, as a client finds it.
struct World {
  FrameLog log{std::size_t{1} << 16};
  ServedMap map{log, {7, 0}};
  MapPublisher publisher{log, {7, 0}};
  Conversation conversation{map, {"fuzz", Anchor{}, {}, 512}};

  World() {
    VectorMap lines;
    for (LineId id = 1; id <= 20; ++id) {
      MapLine& line = lines[id];
      line.id = id;
      for (int i = 0; i < 10; ++i) line.vertices.push_back({10.0 * i, 7.0 * static_cast<double>(id)});
      MapChange change;
      change.upserted = {id};
      publisher.publish(change, lines, [](std::size_t) {});
    }
    if (map.take_new() != ServedMap::Taken::all) std::abort();
    conversation.set_pose({});
  }
};

}  // namespace

/// A client's whole byte stream, as the session of a real socket pair receives it: nothing it sends may crash, and the
/// answer to every request is a frame. The first input byte decides how the stream is cut into reads.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static World world;
  std::array<int, 2> ends{};
  if (size == 0 || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends.data()) != 0) return 0;
  const FileDescriptor client(ends[1]);
  Session session{FileDescriptor{ends[0]}, Peer{}, 0};
  char sink[1 << 16];
  const std::size_t step = 1 + data[0];
  for (std::size_t at = 1; at < size; at += step) {
    if (::send(client.get(), data + at, std::min(step, size - at), MSG_NOSIGNAL) < 0) break;
    if (!session.receive(0)) break;
    while (const auto envelope = session.input().next()) {
      if (world.conversation.answer(session, *envelope, 0)) return 0;
      while (world.conversation.follow(session, 0, true)) {
      }
      while (session.has_output()) {
        if (!session.send(0)) return 0;
        while (::recv(client.get(), sink, sizeof sink, MSG_DONTWAIT) > 0) {
        }
      }
    }
    if (session.input().wrong_length()) return 0;
  }
  return 0;
}
