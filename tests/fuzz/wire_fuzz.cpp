#include <cstdint>
#include <cstdlib>
#include <vector>

#include "core/wire/codec.h"
#include "core/wire/map_replica.h"

/// Any bytes as an Envelope: what decodes must encode again to something that decodes to the same, and the replica
/// takes it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec::wire;
  static std::vector<char> first_buffer(std::size_t{1} << 20), second_buffer(std::size_t{1} << 20);
  const std::string_view envelope(reinterpret_cast<const char*>(data), size);
  for (const Sender sender : {Sender::server, Sender::client}) {
    const roadvec::Expected<Message> message = decode_envelope(envelope, sender);
    if (!message) continue;
    MapReplica replica = MapReplica::empty_at(0, 0);
    (void)replica.apply(SnapshotBegin{});
    (void)replica.apply(*message);
    (void)replica.apply(SnapshotEnd{});
    (void)replica.apply(*message);
    (void)replica.lines();
    std::visit(
        [&](const auto& m) {
          using M = std::decay_t<decltype(m)>;
          if constexpr (!std::is_same_v<M, Unknown>) {
            const std::string_view once = encode_frame(m, first_buffer);
            if (once.empty()) return;
            const roadvec::Expected<Message> again = decode_envelope(once.substr(kFrameHeaderBytes), sender);
            if (!again || encode_frame(std::get<M>(*again), second_buffer) != once) std::abort();
          }
        },
        *message);
  }
  return 0;
}
