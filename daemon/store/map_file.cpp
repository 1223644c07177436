#include "daemon/store/map_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <string_view>

#include "daemon/store/schema.h"

namespace roadvec {
namespace {

/// A reader that stays open keeps the log from being reused; beyond 16 MiB it is cut once he has gone. It goes into the
/// file when we ask for it: whoever else writes there is found out.
constexpr const char* kLiveSettings =
    "PRAGMA synchronous = FULL; PRAGMA journal_size_limit = 16777216; PRAGMA wal_autocheckpoint = 0; SELECT count(*) "
    "FROM sqlite_master; "
    "PRAGMA wal_checkpoint(TRUNCATE)";

/// As SQLite itself has it: a thousand pages.
constexpr std::uintmax_t kTakeInLog_bytes = 4 << 20;

constexpr const char* kNow = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')";

constexpr const char* kUpsert = R"(
INSERT INTO boundaries (geom, part, line_id, revision, kind, height_m, existence, observation_count, first_end, last_end,
  first_seen_ns, last_seen_ns, sigma_across_m, sigma_along_m) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
ON CONFLICT (part, line_id) DO UPDATE SET geom = excluded.geom, revision = excluded.revision, kind = excluded.kind,
  height_m = excluded.height_m, existence = excluded.existence, observation_count = excluded.observation_count,
  first_end = excluded.first_end, last_end = excluded.last_end, first_seen_ns = excluded.first_seen_ns,
  last_seen_ns = excluded.last_seen_ns, sigma_across_m = excluded.sigma_across_m, sigma_along_m = excluded.sigma_along_m)";

constexpr const char* kSelectLines = R"(
SELECT geom, line_id, revision, kind, height_m, existence, observation_count, first_end, last_end, first_seen_ns,
  last_seen_ns, sigma_across_m, sigma_along_m FROM boundaries WHERE part = ? ORDER BY line_id)";

template <class Kind, std::size_t N>
Kind kind_named(const std::array<std::string_view, N>& names, const std::string& name) {
  const auto found = std::ranges::find(names, name);
  return found == names.end() ? Kind{} : static_cast<Kind>(found - names.begin());
}

/// A row of kSelectLines; false when its geometry cannot be read.
bool read_line(const Statement& row, const GeographicLib::LocalCartesian& enu, MapLine& line) {
  const auto positions = positions_in(row.blob(0));
  if (!positions) return false;
  line.id = static_cast<LineId>(row.integer(1));
  line.revision = static_cast<std::uint32_t>(row.integer(2));
  line.attributes.kind = kind_named<BoundaryKind>(kBoundaryKindNames, row.text(3));
  line.attributes.height_m = static_cast<float>(row.real(4));
  line.attributes.existence = static_cast<float>(row.real(5));
  line.attributes.observation_count = static_cast<std::uint32_t>(row.integer(6));
  line.attributes.first_end = kind_named<EndKind>(kEndKindNames, row.text(7));
  line.attributes.last_end = kind_named<EndKind>(kEndKindNames, row.text(8));
  line.first_seen.ns = row.integer(9);
  line.last_seen.ns = row.integer(10);
  const auto sigma_across_m = static_cast<float>(row.real(11)), sigma_along_m = static_cast<float>(row.real(12));
  for (const GeoPosition& p : *positions) {
    double x_m = 0, y_m = 0, z_m = 0;
    enu.Forward(p.latitude_deg, p.longitude_deg, p.height_m, x_m, y_m, z_m);
    line.vertices.push_back({published_m(x_m), published_m(y_m), static_cast<float>(published_m(z_m)),
                             line.attributes.height_m, sigma_across_m, sigma_along_m});
  }
  return true;
}

/// The whole file is read: seconds for a map of gigabytes, so only when nobody has a lock that would end the opening.
Stored<void> find_whole(const Database& database) {
  Stored<void> unlocked = database.run("BEGIN EXCLUSIVE; ROLLBACK");
  if (!unlocked) return unlocked;
  const Stored<std::string> verdict = database.text("PRAGMA integrity_check(1)");
  if (!verdict) return tl::unexpected<StoreError>(verdict.error());
  if (*verdict != "ok") return in_trouble(StoreTrouble::damaged, "integrity check: " + *verdict);
  return {};
}

/// WAL is asserted anew, because QGIS with write access leaves a file without it; full: a commit is on the disk when it
/// returns. What an earlier run left in the log goes into the file, so that the log holds the present part alone.
Stored<void> prepare_to_write(const Database& database) {
  const Stored<std::string> mode = database.text("PRAGMA journal_mode = WAL");
  if (!mode) return tl::unexpected<StoreError>(mode.error());
  if (*mode != "wal") return in_trouble(StoreTrouble::unwritable, "its file system cannot share memory (WAL)");
  // The log is opened by the first read after the switch; a checkpoint before that is refused.
  return database.run(kLiveSettings);
}

}  // namespace

Stored<MapFile> MapFile::open(const std::filesystem::path& path) {
  Stored<Database> database = Database::open(path.string(), Database::Mode::make);
  if (!database) return tl::unexpected<StoreError>(database.error());
  if (database->is_read_only()) return in_trouble(StoreTrouble::unwritable, "it may only be read");
  const Stored<void> ready = find_whole(*database).and_then([&] { return bring_up_to(*database); }).and_then([&] {
    return prepare_to_write(*database);
  });
  if (!ready) return tl::unexpected<StoreError>(ready.error());
  return MapFile(std::move(*database), path);
}

Stored<MapFile> MapFile::open_to_read(const std::filesystem::path& path) {
  Stored<Database> database = Database::open(path.string(), Database::Mode::read);
  if (!database) return tl::unexpected<StoreError>(database.error());
  const Stored<std::int64_t> version = database->number("SELECT version FROM x_schema");
  if (!version && version.error().trouble == StoreTrouble::foreign) {
    return in_trouble(StoreTrouble::foreign, "not a map of roadvecd (" + version.error().text + ")");
  }
  if (!version) return tl::unexpected<StoreError>(version.error());
  if (*version != kSchemaVersion) {
    return in_trouble(StoreTrouble::newer, "schema version " + std::to_string(*version) + ", this program reads " +
                                               std::to_string(kSchemaVersion));
  }
  return MapFile(std::move(*database), path);
}

MapFile::Stamp MapFile::stamp() const {
  struct stat facts {};
  if (::stat(path_.c_str(), &facts) != 0) return {};
  return {std::int64_t{facts.st_mtim.tv_sec} * 1'000'000'000 + facts.st_mtim.tv_nsec, facts.st_size};
}

Stored<void> MapFile::find_unchanged() {
  if (database_.has_moved()) return in_trouble(StoreTrouble::replaced, "another file has its name, or none");
  const Stamp now = stamp();
  if (now == stamp_) return {};
  // Another SQLite may have taken in the log; a file copied over this one does not go with the log.
  const Stored<Database> other = Database::open(path_.string(), Database::Mode::read);
  if (!other) return tl::unexpected<StoreError>(other.error());
  const Stored<std::string> verdict = other->text("PRAGMA integrity_check(1)");
  const auto as_we_left_it =
      other->number("SELECT count(*) FROM parts WHERE part = " + std::to_string(written_.number) +
                    " AND seq = " + std::to_string(written_.head.seq) +
                    " AND epoch = " + std::to_string(static_cast<std::int64_t>(written_.head.epoch)));
  const bool is_ours = as_we_left_it && (*as_we_left_it == 1 || written_.number == 0);
  if (verdict != "ok" || !is_ours) return in_trouble(StoreTrouble::replaced, "others have written into it");
  stamp_ = now;
  return {};
}

/// Now and then, so that neither the log nor what a start reads of it grows.
Stored<void> MapFile::take_in_log() {
  std::error_code error;
  const std::uintmax_t log_bytes = std::filesystem::file_size(path_.string() + "-wal", error);
  if (error || log_bytes < kTakeInLog_bytes) return {};
  Stored<void> done = database_.run("PRAGMA wal_checkpoint(PASSIVE)");
  stamp_ = stamp();
  return done;
}

Stored<void> MapFile::write(MapPart& part, const VectorMap& map, const std::set<LineId>& changed,
                            const DriveRows& drive) {
  if (Stored<void> unchanged = find_unchanged(); !unchanged) return unchanged;
  MapPart written = part;
  Stored<void> done = database_.run("BEGIN IMMEDIATE")
                          .and_then([&] { return write_part(written); })
                          .and_then([&] { return write_lines(written, map, changed); })
                          .and_then([&] { return write_drive(database_, written.number, drive); })
                          .and_then([&] { return database_.run("COMMIT"); });
  if (!done) {
    database_.roll_back();
    return done;
  }
  written_ = written;
  // What went into a file that has lost its name would be lost with it.
  done = find_unchanged().and_then([&] { return take_in_log(); });
  if (done) part = written;
  return done;
}

Stored<void> MapFile::write_part(MapPart& part) const {
  const auto epoch = static_cast<std::int64_t>(part.head.epoch), seq = static_cast<std::int64_t>(part.head.seq);
  const auto finished = static_cast<std::int64_t>(part.finished);
  if (part.number != 0) {
    Stored<Statement> update = database_.prepare(
        std::string("UPDATE parts SET epoch = ?, seq = ?, finished = ?, continues = nullif(?, 0), changed = ") + kNow +
        " WHERE part = ?");
    if (!update) return tl::unexpected<StoreError>(update.error());
    Stored<void> done = update->execute(epoch, seq, finished, part.continues, part.number);
    if (done && database_.changed_rows() != 1) return in_trouble(StoreTrouble::replaced, "what was written has gone");
    return done;
  }
  Stored<Statement> insert = database_.prepare(
      std::string("INSERT INTO parts (epoch, seq, finished, continues, anchor_latitude_deg, anchor_longitude_deg, "
                  "anchor_height_m, anchor_yaw_deg, began, changed) VALUES (?, ?, ?, nullif(?, 0), ?, ?, ?, ?, ") +
      kNow + ", " + kNow + ")");
  if (!insert) return tl::unexpected<StoreError>(insert.error());
  const Anchor& a = part.anchor;
  Stored<void> done =
      insert->execute(epoch, seq, finished, part.continues, a.latitude_deg, a.longitude_deg, a.height_m, a.yaw_deg);
  if (!done) return done;
  return database_.number("SELECT last_insert_rowid()").map([&](std::int64_t number) { part.number = number; });
}

Stored<void> MapFile::write_lines(const MapPart& part, const VectorMap& map, const std::set<LineId>& changed) const {
  Stored<Statement> upsert = database_.prepare(kUpsert);
  Stored<Statement> remove = database_.prepare("DELETE FROM boundaries WHERE part = ? AND line_id = ?");
  if (!upsert) return tl::unexpected<StoreError>(upsert.error());
  if (!remove) return tl::unexpected<StoreError>(remove.error());
  const GeographicLib::LocalCartesian enu = enu_at(part.anchor);
  GeoEnvelope extent;
  for (const LineId id : changed) {
    const auto line_id = static_cast<std::int64_t>(id);
    const auto found = map.find(id);
    Stored<void> done;
    if (found == map.end() || found->second.vertices.size() < 2) {
      done = remove->execute(part.number, line_id);
    } else {
      const MapLine& line = found->second;
      const LineAttributes& a = line.attributes;
      const std::vector<GeoPosition> positions = geo_positions(line, enu);
      GeoEnvelope envelope;
      for (const GeoPosition& p : positions) envelope.add(p);
      extent.add(envelope);
      const std::vector<std::uint8_t> blob = geometry_blob(positions, envelope);
      done =
          upsert->execute(std::span<const std::uint8_t>(blob), part.number, line_id, std::int64_t{line.revision},
                          name_of(a.kind), double{a.height_m}, double{a.existence}, std::int64_t{a.observation_count},
                          name_of(a.first_end), name_of(a.last_end), line.first_seen.ns, line.last_seen.ns,
                          rms_m(line, &Vertex::sigma_across_m), rms_m(line, &Vertex::sigma_along_m));
    }
    if (!done) return done;
  }
  return note_extent(extent);
}

/// What GIS programs zoom to. It only grows: that is what the standard asks for, and it costs no walk over the map.
Stored<void> MapFile::note_extent(const GeoEnvelope& extent) const {
  const bool grows = extent.min_longitude_deg <= extent.max_longitude_deg;
  Stored<Statement> note = database_.prepare(
      std::string("UPDATE gpkg_contents SET last_change = ") + kNow +
      (grows ? ", min_x = min(coalesce(min_x, ?1), ?1), max_x = max(coalesce(max_x, ?2), ?2), min_y = "
               "min(coalesce(min_y, ?3), ?3), max_y = max(coalesce(max_y, ?4), ?4)"
             : "") +
      " WHERE table_name = 'boundaries'");
  if (!note) return tl::unexpected<StoreError>(note.error());
  if (!grows) return note->execute();
  return note->execute(extent.min_longitude_deg, extent.max_longitude_deg, extent.min_latitude_deg,
                       extent.max_latitude_deg);
}

Stored<std::vector<MapPart>> MapFile::parts() const {
  Stored<Statement> query = database_.prepare(
      "SELECT part, epoch, seq, finished, anchor_latitude_deg, anchor_longitude_deg, anchor_height_m, anchor_yaw_deg, "
      "continues, let_go FROM parts ORDER BY part");
  if (!query) return tl::unexpected<StoreError>(query.error());
  std::vector<MapPart> parts;
  for (;;) {
    const Stored<bool> row = query->step();
    if (!row) return tl::unexpected<StoreError>(row.error());
    if (!*row) return parts;
    MapPart& part = parts.emplace_back();
    part.number = query->integer(0);
    part.head = {static_cast<std::uint64_t>(query->integer(1)), static_cast<std::uint64_t>(query->integer(2))};
    part.finished = query->integer(3) != 0;
    part.anchor = {query->real(4), query->real(5), query->real(6), query->real(7)};
    part.continues = query->integer(8);
    part.let_go = query->integer(9) != 0;
  }
}

Stored<VectorMap> MapFile::lines(const MapPart& part) const {
  Stored<Statement> query = database_.prepare(kSelectLines);
  if (!query) return tl::unexpected<StoreError>(query.error());
  query->bind_all(part.number);
  const GeographicLib::LocalCartesian enu = enu_at(part.anchor);
  VectorMap map;
  for (;;) {
    const Stored<bool> row = query->step();
    if (!row) return tl::unexpected<StoreError>(row.error());
    if (!*row) return map;
    MapLine line;
    if (!read_line(*query, enu, line)) {
      return in_trouble(StoreTrouble::damaged, "line " + std::to_string(line.id) + " has no LineString Z");
    }
    map.emplace(line.id, std::move(line));
  }
}

/// The part and those before it, the earliest first. A part only continues earlier ones.
Stored<std::vector<std::int64_t>> MapFile::continued_by(const MapPart& part) const {
  std::vector<std::int64_t> chain;
  for (std::int64_t number = part.number; number > 0 && (chain.empty() || number < chain.front());) {
    chain.insert(chain.begin(), number);
    const Stored<std::int64_t> before =
        database_.number("SELECT coalesce(continues, 0) FROM parts WHERE part = " + std::to_string(number));
    if (!before) return tl::unexpected<StoreError>(before.error());
    number = *before;
  }
  return chain;
}

Stored<void> MapFile::take_over(const MapPart& part) const {
  const Stored<std::vector<std::int64_t>> chain = continued_by(part);
  if (!chain) return tl::unexpected<StoreError>(chain.error());
  for (const std::int64_t number : *chain) {
    if (number == part.number) continue;
    Stored<void> done = database_.run("DELETE FROM boundaries WHERE part = " + std::to_string(number));
    if (!done) return done;
  }
  return {};
}

Stored<Recollection> MapFile::drive(const MapPart& part) const {
  return continued_by(part).and_then([&](const auto& chain) { return read_drive(database_, chain); });
}

Stored<DriveReach> MapFile::reach(const MapPart& part, const Eigen::Vector2d& place_map) const {
  return continued_by(part).and_then([&](const auto& chain) { return reach_of_drive(database_, chain, place_map); });
}

}  // namespace roadvec
