#include <cinttypes>
#include <cstdio>

#include "tools/roadvec/commands.h"
#include "tools/roadvec/json.h"

namespace roadvec {

int control(const Connection& connection, const wire::Command& command) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  if (auto sent = client->send(command); !sent) return complain(sent.error(), kExitFailure);
  const Expected<wire::CommandResult> result =
      client->receive_one<wire::CommandResult>(MapClient::Seconds(connection.timeout_s));
  if (!result) return complain(result.error(), kExitFailure);
  if (!result->done) return complain({result->text}, kExitFailure);
  if (connection.json) {
    std::puts(json_of(*result).c_str());
  } else {
    std::printf("%s; changes up to %" PRIu64 " are on disk\n", result->text.c_str(), result->durable_seq);
  }
  return kExitOk;
}

}  // namespace roadvec
