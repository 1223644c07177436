#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/geometry/anchor.h"
#include "core/map/vector_map.h"
#include "daemon/server/map_publisher.h"
#include "daemon/store/database.h"
#include "daemon/store/drive_tables.h"
#include "daemon/store/geometry.h"

namespace roadvec {

/// What one start of roadvecd has mapped; a row of the table `parts`.
struct MapPart {
  std::int64_t number = 0;
  Anchor anchor;
  MapHead head;
  bool finished = false;
  std::int64_t continues = 0;  ///< the part whose drive this one goes on with; 0: none
  bool let_go = false;         ///< the owner began a new map after it: no later start goes on with it
};

/// A map as a GeoPackage: opened, brought up to the present schema and found whole. README.md in this folder describes
/// the file.
class MapFile {
 public:
  /// For writing while others read (WAL; every commit is on the disk when it returns). Makes the file if there is none.
  [[nodiscard]] static Stored<MapFile> open(const std::filesystem::path& path);
  [[nodiscard]] static Stored<MapFile> open_to_read(const std::filesystem::path& path);

  /// Puts the lines `changed` into the part as they are in `map`, or takes them out where they are not, and notes what
  /// the part has come to; all of it or nothing. A part numbered 0 is new and gets its number. Fails with `replaced`
  /// when the path names another file, before or after, when others have written into the file and left it damaged, or
  /// when the part is gone from it.
  [[nodiscard]] Stored<void> write(MapPart& part, const VectorMap& map, const std::set<LineId>& changed,
                                   const DriveRows& drive = {});
  /// Takes the lines of the parts that it continues out of the file: they are this part's now.
  [[nodiscard]] Stored<void> take_over(const MapPart& part) const;
  /// No later start goes on with any of the parts but this one.
  [[nodiscard]] Stored<void> let_go(std::int64_t but) const {
    return database_.run("UPDATE parts SET let_go = 1 WHERE part <> " + std::to_string(but));
  }

  /// In the order in which they were begun.
  [[nodiscard]] Stored<std::vector<MapPart>> parts() const;
  /// The part's lines in whole millimetres; what the file keeps per line (height, sigmas), each vertex gets.
  [[nodiscard]] Stored<VectorMap> lines(const MapPart& part) const;

  /// What the part was made from, and the parts that it continues; empty when none of that was kept.
  [[nodiscard]] Stored<Recollection> drive(const MapPart& part) const;
  [[nodiscard]] Stored<DriveReach> reach(const MapPart& part, const Eigen::Vector2d& place_map) const;

  /// As write(), when there is nothing to write.
  [[nodiscard]] Stored<void> find_unchanged();
  /// One file without a log beside it, which every SQLite opens; nobody may be reading.
  [[nodiscard]] Stored<void> leave_wal() const { return database_.run("PRAGMA journal_mode = DELETE"); }

 private:
  /// What changes when somebody writes into the file, and not into the log beside it.
  struct Stamp {
    std::int64_t modified_ns = 0, size_bytes = 0;
    friend bool operator==(const Stamp&, const Stamp&) = default;
  };
  MapFile(Database database, std::filesystem::path path)
      : database_(std::move(database)), path_(std::move(path)), stamp_(stamp()) {}
  [[nodiscard]] Stamp stamp() const;
  [[nodiscard]] Stored<void> take_in_log();
  [[nodiscard]] Stored<void> write_part(MapPart& part) const;
  [[nodiscard]] Stored<void> write_lines(const MapPart& part, const VectorMap& map,
                                         const std::set<LineId>& changed) const;
  [[nodiscard]] Stored<std::vector<std::int64_t>> continued_by(const MapPart& part) const;
  [[nodiscard]] Stored<void> note_extent(const GeoEnvelope& extent) const;

  Database database_;
  std::filesystem::path path_;
  MapPart written_;  ///< since it was opened
  Stamp stamp_;      ///< since we last wrote into the file itself
};

}  // namespace roadvec
