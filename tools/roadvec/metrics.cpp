#include <cstdio>

#include "tools/roadvec/commands.h"

namespace roadvec {

int show_metrics(const Connection& connection) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  if (auto sent = client->send(wire::GetMetrics{}); !sent) return complain(sent.error(), kExitFailure);
  const Expected<wire::Metrics> metrics = client->receive_one<wire::Metrics>(MapClient::Seconds(connection.timeout_s));
  if (!metrics) return complain(metrics.error(), kExitFailure);
  std::fputs(metrics->text.c_str(), stdout);
  return kExitOk;
}

}  // namespace roadvec
