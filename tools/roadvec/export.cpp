#include <cstdio>
#include <cstring>
#include <fstream>

#include "core/wire/map_replica.h"
#include "daemon/server/map_files.h"
#include "tools/roadvec/commands.h"

namespace roadvec {
namespace {

/// The whole map, as a subscriber's snapshot gives it.
Expected<VectorMap> fetch_map(MapClient& client, MapClient::Seconds timeout) {
  if (auto sent = client.send(wire::Subscribe{}); !sent) return tl::unexpected<Error>(sent.error());
  wire::MapReplica replica;
  while (!replica.consistent()) {
    const Expected<wire::Message> message = client.receive(timeout);
    if (!message) return tl::unexpected<Error>(message.error());
    if (const auto* bye = std::get_if<wire::Bye>(&*message))
      return fail("the daemon closed the connection: " + bye->text);
    if (replica.apply(*message) == wire::MapReplica::Outcome::out_of_order) return fail("a part of the map is missing");
  }
  return replica.lines();
}

int write(const std::string& text, const std::string& path) {
  if (path == "-") {
    const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
    return written ? kExitOk : complain({"cannot write to standard output"}, kExitFailure);
  }
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  return file ? kExitOk : complain({"cannot write " + path + ": " + std::strerror(errno)}, kExitFailure);
}

}  // namespace

int export_geojson(const Connection& connection, const std::string& output_path) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  if (!client->welcome().anchor)
    return complain({"the daemon does not know its place on Earth yet (no anchor)"}, kExitFailure);
  const Expected<VectorMap> map = fetch_map(*client, MapClient::Seconds(connection.timeout_s));
  if (!map) return complain(map.error(), kExitFailure);
  return write(geojson_of(*map, *client->welcome().anchor), output_path);
}

int render_svg(const Connection& connection, const std::string& output_path, const std::string& title) {
  Expected<MapClient> client = connect(connection);
  if (!client) return complain(client.error(), kExitNoDaemon);
  const Expected<VectorMap> map = fetch_map(*client, MapClient::Seconds(connection.timeout_s));
  if (!map) return complain(map.error(), kExitFailure);
  return write(svg_of(*map, {}, title), output_path);
}

}  // namespace roadvec
