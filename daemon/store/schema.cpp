#include "daemon/store/schema.h"

#include <array>

namespace roadvec {
namespace {

constexpr std::int64_t kGeoPackageId = 0x47504B47;  // "GPKG" [GeoPackage, 1.1.1.1.1]

/// A step makes version i + 1 of version i. A step that has been released is never changed: a new one follows it.
const std::array<const char*, kSchemaVersion> kSteps{
    // 1: what every GeoPackage has, the lines, and the parts they belong to. No rtree: its triggers call functions that
    // plain SQLite lacks, so every other writer would break.
    R"(
PRAGMA application_id = 1196444487;
PRAGMA user_version = 10300;
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL,
  organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
INSERT INTO gpkg_spatial_ref_sys VALUES
  ('Undefined Cartesian SRS', -1, 'NONE', -1, 'undefined', 'undefined Cartesian coordinate reference system'),
  ('Undefined geographic SRS', 0, 'NONE', 0, 'undefined', 'undefined geographic coordinate reference system'),
  ('WGS 84 geodetic', 4326, 'EPSG', 4326, 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,'
   || 'AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],'
   || 'UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]',
   'longitude and latitude in degrees on the WGS 84 ellipsoid, height above it in metres');
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE, description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL,
  z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE boundaries (
  fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom LINESTRING, part INTEGER NOT NULL, line_id INTEGER NOT NULL,
  revision INTEGER NOT NULL, kind TEXT NOT NULL, height_m DOUBLE NOT NULL, existence DOUBLE NOT NULL,
  observation_count INTEGER NOT NULL, first_end TEXT NOT NULL, last_end TEXT NOT NULL, first_seen_ns INTEGER NOT NULL,
  last_seen_ns INTEGER NOT NULL, sigma_across_m DOUBLE NOT NULL, sigma_along_m DOUBLE NOT NULL,
  UNIQUE (part, line_id));
CREATE TABLE parts (
  part INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, epoch INTEGER NOT NULL, seq INTEGER NOT NULL,
  anchor_latitude_deg DOUBLE NOT NULL, anchor_longitude_deg DOUBLE NOT NULL, anchor_height_m DOUBLE NOT NULL,
  anchor_yaw_deg DOUBLE NOT NULL, began DATETIME NOT NULL, changed DATETIME NOT NULL);
INSERT INTO gpkg_contents (table_name, data_type, identifier, description, srs_id) VALUES
  ('boundaries', 'features', 'boundaries', 'boundaries of the road', 4326),
  ('parts', 'attributes', 'parts', 'drives that the boundaries come from', NULL);
INSERT INTO gpkg_geometry_columns VALUES ('boundaries', 'geom', 'LINESTRING', 4326, 1, 0);
CREATE TABLE x_schema (version INTEGER NOT NULL);
INSERT INTO x_schema VALUES (1);
)",
    // 2: whether the program ended by itself.
    R"(
ALTER TABLE parts ADD COLUMN finished BOOLEAN NOT NULL DEFAULT 0;
UPDATE x_schema SET version = 2;
)",
    // 3: what the maps were made from, so that a later start goes on with one.
    R"(
ALTER TABLE parts ADD COLUMN continues INTEGER;
ALTER TABLE parts ADD COLUMN let_go BOOLEAN NOT NULL DEFAULT 0;
CREATE TABLE x_keyframes (
  part INTEGER NOT NULL, keyframe INTEGER NOT NULL, time_ns INTEGER NOT NULL, x_m DOUBLE NOT NULL, y_m DOUBLE NOT NULL,
  heading_rad DOUBLE NOT NULL, travelled_m DOUBLE NOT NULL, step BLOB NOT NULL, lvm BLOB NOT NULL,
  structure BLOB NOT NULL, PRIMARY KEY (part, keyframe));
CREATE TABLE x_loops (
  part INTEGER NOT NULL, from_keyframe INTEGER NOT NULL, to_keyframe INTEGER NOT NULL, edge BLOB NOT NULL,
  PRIMARY KEY (part, from_keyframe, to_keyframe));
UPDATE x_schema SET version = 3;
)"};

/// 0: nothing in it yet.
Stored<std::int64_t> version_of(const Database& database) {
  Stored<std::int64_t> table_count = database.number("SELECT count(*) FROM sqlite_master");
  if (!table_count || *table_count == 0) return table_count;
  Stored<std::int64_t> id = database.number("PRAGMA application_id");
  if (!id) return id;
  if (*id != kGeoPackageId) return in_trouble(StoreTrouble::foreign, "not a GeoPackage");
  Stored<std::int64_t> ours =
      database.number("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('x_schema', 'boundaries')");
  if (!ours) return ours;
  if (*ours != 2) return in_trouble(StoreTrouble::foreign, "a GeoPackage, but not a map of roadvecd");
  return database.number("SELECT version FROM x_schema");
}

}  // namespace

Stored<void> bring_up_to(const Database& database, std::int64_t version) {
  const Stored<std::int64_t> found = version_of(database);
  if (!found) return tl::unexpected<StoreError>(found.error());
  if (*found == version) return {};
  if (*found > version) {
    return in_trouble(StoreTrouble::newer, "schema version " + std::to_string(*found) + ", this program knows " +
                                               std::to_string(version) + ": made by a later roadvecd");
  }
  if (*found < 0) return in_trouble(StoreTrouble::foreign, "schema version " + std::to_string(*found));
  std::string steps = "BEGIN IMMEDIATE;";
  for (auto step = static_cast<std::size_t>(*found); step < static_cast<std::size_t>(version); ++step) {
    steps += kSteps[step];
  }
  Stored<void> done = database.run(steps + "COMMIT;");
  if (!done) database.roll_back();
  return done;
}

}  // namespace roadvec
