#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/wire/map_replica.h"
#include "daemon/server/map_files.h"
#include "daemon/store/map_file.h"
#include "tools/roadvec/commands.h"

namespace roadvec {
namespace {

/// What is exported, from the daemon or from a file that it keeps.
struct WholeMap {
  VectorMap lines;
  std::optional<Anchor> anchor;
  MapHead head;
};
struct Refusal {
  Error error;
  int exit_code = kExitFailure;
};
using Fetched = tl::expected<WholeMap, Refusal>;
tl::unexpected<Refusal> refused(Error error, int exit_code = kExitFailure) {
  return tl::unexpected<Refusal>(Refusal{std::move(error), exit_code});
}

/// As a subscriber's snapshot gives it.
Fetched map_of_daemon(const Connection& connection) {
  Expected<MapClient> client = connect(connection);
  if (!client) return refused(client.error(), kExitNoDaemon);
  if (auto sent = client->send(wire::Subscribe{}); !sent) return refused(sent.error());
  wire::MapReplica replica;
  while (!replica.consistent()) {
    const Expected<wire::Message> message = client->receive(MapClient::Seconds(connection.timeout_s));
    if (!message) return refused(message.error());
    if (const auto* bye = std::get_if<wire::Bye>(&*message)) {
      return refused({"the daemon closed the connection: " + bye->text});
    }
    if (replica.apply(*message) == wire::MapReplica::Outcome::out_of_order) {
      return refused({"a part of the map is missing"});
    }
  }
  return WholeMap{replica.lines(), client->welcome().anchor, {replica.epoch(), replica.seq()}};
}

Error in_file(const std::string& path, const StoreError& error) {
  const bool busy = error.trouble == StoreTrouble::locked || error.trouble == StoreTrouble::unwritable;
  return {path + ": " + error.text + (busy ? "; may you read it and the files beside it?" : "")};
}

Fetched map_of_file(const std::string& path, std::int64_t part_number) {
  const Stored<MapFile> file = MapFile::open_to_read(path);
  if (!file) return refused(in_file(path, file.error()));
  const Stored<std::vector<MapPart>> parts = file->parts();
  if (!parts) return refused(in_file(path, parts.error()));
  const MapPart* chosen = nullptr;
  std::string numbers;
  for (const MapPart& part : *parts) {
    numbers += (numbers.empty() ? "" : ", ") + std::to_string(part.number);
    if (part_number == 0 || part.number == part_number) chosen = &part;
  }
  if (chosen == nullptr) {
    return refused({path + " has no such part; it has " + (numbers.empty() ? "none" : numbers)});
  }
  Stored<VectorMap> lines = file->lines(*chosen);
  if (!lines) return refused(in_file(path, lines.error()));
  return WholeMap{std::move(*lines), chosen->anchor, chosen->head};
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

/// With what SQLite keeps beside it, which would be taken for the next file's.
void remove_gpkg(const std::string& path) {
  for (const char* suffix : {"", "-wal", "-shm"}) {
    std::error_code missing;
    std::filesystem::remove(path + suffix, missing);
  }
}

/// Under another name first: the good name never belongs to half a file.
int write_gpkg(const WholeMap& map, const std::string& path) {
  if (path == "-") return complain({"a GeoPackage is no stream: name a file with -o"}, kExitUsage);
  // The log of the file that is there would be taken for the new one's.
  if (std::filesystem::exists(path + "-wal")) {
    return complain({path + " is in use, or was left unfinished (" + path + "-wal): name another file with -o"},
                    kExitFailure);
  }
  const std::string beginning = path + ".part";
  remove_gpkg(beginning);
  MapPart part{.number = 0, .anchor = *map.anchor, .head = map.head, .finished = true};
  std::set<LineId> all;
  for (const auto& [id, line] : map.lines) all.insert(id);
  const Stored<void> written = MapFile::open(beginning).and_then(
      [&](MapFile&& file) { return file.write(part, map.lines, all).and_then([&] { return file.leave_wal(); }); });
  std::error_code error;
  if (written) std::filesystem::rename(beginning, path, error);
  if (written && !error) return kExitOk;
  const std::string reason = written ? error.message() : written.error().text;
  remove_gpkg(beginning);
  return complain({"cannot write " + path + ": " + reason}, kExitFailure);
}

}  // namespace

int export_map(const Connection& connection, const ExportChoice& choice) {
  const Fetched map = choice.map_file.empty() ? map_of_daemon(connection) : map_of_file(choice.map_file, choice.part);
  if (!map) return complain(map.error().error, map.error().exit_code);
  if (!map->anchor) return complain({"the daemon does not know its place on Earth yet (no anchor)"}, kExitFailure);
  switch (choice.format) {
    case ExportFormat::gpkg:
      return write_gpkg(*map, choice.output_path);
    case ExportFormat::lanelet2:
      return write(lanelet2_of(map->lines, *map->anchor), choice.output_path);
    case ExportFormat::geojson:
      break;
  }
  return write(geojson_of(map->lines, *map->anchor), choice.output_path);
}

int render_svg(const Connection& connection, const std::string& output_path, const std::string& title) {
  const Fetched map = map_of_daemon(connection);
  if (!map) return complain(map.error().error, map.error().exit_code);
  return write(svg_of(map->lines, {}, title), output_path);
}

}  // namespace roadvec
