#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/geometry/anchor.h"
#include "core/geometry/pose2.h"
#include "core/map/tiles.h"

/// The messages of roadvec.proto as C++ values. What each field means stands there, once; names are the same except
/// that times are SensorTime and tiles, deltas and lineage are those of core/map.
namespace roadvec::wire {

inline constexpr std::uint32_t kProtoMajor = 1, kProtoMinor = 2;

struct Hello {
  std::uint32_t proto_major = kProtoMajor, proto_minor = kProtoMinor;
  std::string client_name;
  std::uint64_t capabilities = 0;
};
struct Welcome {
  std::uint32_t proto_major = kProtoMajor, proto_minor = kProtoMinor;
  std::uint64_t epoch = 0, head_seq = 0, oldest_seq = 0;
  std::optional<Anchor> anchor;
  Pose2 T_map_odom;
  std::string server_version;
  std::uint32_t tile_size_mm = kTileSize_mm;
};

struct Area {
  std::int32_t x_min_mm = 0, y_min_mm = 0, x_max_mm = 0, y_max_mm = 0;
  [[nodiscard]] bool touches(TileKey key) const;
};
struct KnownTile {
  TileKey key;
  std::uint32_t revision = 0;
};
struct GetTiles {
  std::optional<Area> area;
  double around_vehicle_m = 0;
  std::vector<TileKey> keys;
  std::vector<KnownTile> known;
  std::uint64_t known_epoch = 0;
};
struct Tiles {
  std::uint64_t epoch = 0, as_of_seq = 0;
  std::vector<Tile> tiles;
  bool more = false;
};

struct Resume {
  std::uint64_t epoch = 0, seq = 0;
};
struct Subscribe {
  std::optional<Area> area;
  std::optional<Resume> resume;
  std::vector<KnownTile> known;
  std::uint64_t known_epoch = 0;
  double max_rate_hz = 0;
  bool poses = false, status = false;
};
struct SnapshotBegin {
  std::uint64_t epoch = 0, as_of_seq = 0;
  Pose2 T_map_odom;
  std::uint32_t tile_count = 0;
  bool incremental = false;
};
struct SnapshotEnd {
  std::uint64_t epoch = 0, as_of_seq = 0;
  Pose2 T_map_odom;
};
struct Resumed {
  std::uint64_t from_seq = 0;
};
struct Delta {
  std::uint64_t epoch = 0, seq = 0;
  SensorTime time;
  Pose2 T_map_odom;
  std::vector<TileDelta> tiles;
  std::vector<Lineage> lineage;
  bool continued = false;
};
struct EpochChange {
  enum class Reason : std::uint8_t { unspecified, loop_closure, map_replaced };
  Reason reason = Reason::unspecified;
  std::uint64_t epoch_before = 0, epoch = 0, seq = 0;
  SensorTime time;
  Pose2 T_map_odom_before, T_map_odom_after;
};
struct Overrun {
  std::uint64_t epoch = 0, first_lost_seq = 0, last_lost_seq = 0;
  std::uint32_t tile_count = 0;
  std::optional<Pose2> T_map_odom;  ///< none: from a server of 1.0
};
struct Pose {
  SensorTime time;
  std::uint64_t epoch = 0;
  Pose2 T_map_vehicle, T_odom_vehicle, T_map_odom;
  PoseCovariance covariance = PoseCovariance::Zero();
  double speed_mps = 0, yaw_rate_radps = 0;
};
struct Heartbeat {
  std::uint64_t epoch = 0, head_seq = 0;
};

struct GetStatus {};
struct Counter {
  std::string name;
  std::uint64_t value = 0;
};
struct Gauge {
  std::string name;
  double value = 0;
};
struct Timing {
  std::string step;
  std::uint64_t count = 0;
  double p50_us = 0, p99_us = 0, max_us = 0, sum_us = 0;
  std::vector<std::uint64_t> at_most_counts{};
};
struct Stage {
  std::string name, state;
  std::vector<Counter> counters{};
  std::vector<Gauge> gauges{};
  std::vector<Timing> timings{};
  std::string detail{};
};
struct Status {
  SensorTime time;
  std::string server_version, state, not_growing_reason;
  std::uint64_t epoch = 0, head_seq = 0, durable_seq = 0;
  std::uint64_t keyframe_count = 0, loop_closure_count = 0, line_count = 0, tile_count = 0;
  double map_length_m = 0, travelled_m = 0, uptime_s = 0;
  std::vector<Stage> stages;
  std::optional<Pose> pose{};
};
struct GetMetrics {};
struct Metrics {
  std::string text;
};

struct Bye {
  enum class Reason : std::uint8_t {
    unspecified,
    shutdown,
    protocol_version,
    hello_timeout,
    malformed,
    frame_length,
    frame_timeout,
    stalled,
    too_many_clients,
    unexpected_message,
    map_lost,
    not_authorised
  };
  Reason reason = Reason::unspecified;
  std::string text;
};
struct Error {
  enum class Code : std::uint8_t { unspecified, unsupported, unavailable, not_authorised, invalid };
  Code code = Code::unspecified;
  std::string text;
};
struct Ping {
  std::uint64_t nonce = 0;
};
struct Pong {
  std::uint64_t nonce = 0;
};
struct Save {};
struct NewMap {};
struct ImportMap {
  std::string path;
};
struct Command {
  std::optional<Save> save;
  std::optional<NewMap> new_map;
  std::optional<ImportMap> import_map;
};
struct CommandResult {
  bool done = false;
  std::string text;
  std::uint64_t durable_seq = 0;
};

/// A message of a later minor.
struct Unknown {};

/// An alternative's index is its field number in Envelope.
using Message = std::variant<Unknown, Hello, Welcome, GetTiles, Tiles, Subscribe, SnapshotBegin, Tile, SnapshotEnd,
                             Resumed, Delta, EpochChange, Overrun, Pose, Status, GetStatus, Heartbeat, Bye, Error, Ping,
                             Pong, GetMetrics, Metrics, Command, CommandResult>;

}  // namespace roadvec::wire
