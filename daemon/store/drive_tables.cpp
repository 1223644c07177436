#include "daemon/store/drive_tables.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>

namespace roadvec {
namespace {

static_assert(std::endian::native == std::endian::little, "edges are written as the processor holds them");

/// x, y, heading, and the information row by row.
using EdgeNumbers = std::array<double, 12>;
using EdgeBytes = std::array<std::uint8_t, sizeof(EdgeNumbers)>;

EdgeBytes bytes_of(const PoseEdge& edge) {
  EdgeNumbers numbers{edge.T_from_to.x_m, edge.T_from_to.y_m, edge.T_from_to.theta_rad};
  for (int i = 0; i < 9; ++i) numbers[static_cast<std::size_t>(3 + i)] = edge.information(i / 3, i % 3);
  return std::bit_cast<EdgeBytes>(numbers);
}

std::optional<PoseEdge> edge_in(std::span<const std::uint8_t> bytes, std::size_t from, std::size_t to) {
  EdgeNumbers numbers;
  if (bytes.size() != sizeof numbers) return std::nullopt;
  std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
  if (!std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); })) return std::nullopt;
  PoseEdge edge{from, to, {numbers[0], numbers[1], numbers[2]}};
  for (int i = 0; i < 9; ++i) edge.information(i / 3, i % 3) = numbers[static_cast<std::size_t>(3 + i)];
  return edge;
}

std::string list_of(std::span<const std::int64_t> parts) {
  std::string list;
  for (const std::int64_t part : parts) list += (list.empty() ? "" : ",") + std::to_string(part);
  return "(" + list + ")";
}

template <class Row>
Stored<void> for_each_row(const Database& database, const std::string& sql, Row&& row) {
  Stored<Statement> query = database.prepare(sql);
  if (!query) return tl::unexpected<StoreError>(query.error());
  for (;;) {
    const Stored<bool> stepped = query->step();
    if (!stepped) return tl::unexpected<StoreError>(stepped.error());
    if (!*stepped) return {};
    if (Stored<void> done = row(*query); !done) return done;
  }
}

/// A row of time, pose, way, edge and lines; false when it is none.
bool read_keyframe(const Statement& row, Recollection& to) {
  const std::size_t index = to.keyframes.size();
  const Pose2 pose{row.real(2), row.real(3), row.real(4)};
  const double travelled_m = row.real(5);
  auto lvm = PackedLines::from_bytes(row.blob(7)), structure = PackedLines::from_bytes(row.blob(8));
  const bool is_finite = std::isfinite(pose.x_m + pose.y_m + pose.theta_rad + travelled_m);
  if (!is_finite || !lvm || !structure) return false;
  if (index > 0) {
    const std::optional<PoseEdge> step = edge_in(row.blob(6), index - 1, index);
    if (!step || travelled_m < to.graph.travelled_m.back()) return false;
    to.graph.odometry.push_back(*step);
  }
  to.graph.poses_map.push_back(pose);
  to.graph.travelled_m.push_back(travelled_m);
  to.keyframes.push_back({SensorTime{row.integer(1)}, {}, std::move(*lvm), std::move(*structure)});
  return true;
}

}  // namespace

Stored<void> write_drive(const Database& database, std::int64_t part, const DriveRows& rows) {
  Stored<Statement> keyframe = database.prepare(
      "INSERT INTO x_keyframes VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (part, keyframe) DO UPDATE SET "
      "x_m = excluded.x_m, y_m = excluded.y_m, heading_rad = excluded.heading_rad, step = excluded.step");
  if (!keyframe) return tl::unexpected<StoreError>(keyframe.error());
  for (const JournalKeyframe& row : rows.keyframes) {
    const EdgeBytes step = bytes_of(row.step);
    const std::vector<std::uint8_t> lvm = row.kept.lvm.bytes(), structure = row.kept.structure.bytes();
    const Pose2& pose = row.T_map_vehicle;
    using Bytes = std::span<const std::uint8_t>;
    if (Stored<void> done =
            keyframe->execute(part, static_cast<std::int64_t>(row.number), row.kept.time.ns, pose.x_m, pose.y_m,
                              pose.theta_rad, row.travelled_m, Bytes(step), Bytes(lvm), Bytes(structure));
        !done) {
      return done;
    }
  }
  Stored<Statement> loop = database.prepare(
      "INSERT INTO x_loops VALUES (?, ?, ?, ?) ON CONFLICT (part, from_keyframe, to_keyframe) DO NOTHING");
  if (!loop) return tl::unexpected<StoreError>(loop.error());
  for (const PoseEdge& edge : rows.loops) {
    const EdgeBytes bytes = bytes_of(edge);
    if (Stored<void> done = loop->execute(part, static_cast<std::int64_t>(edge.from),
                                          static_cast<std::int64_t>(edge.to), std::span<const std::uint8_t>(bytes));
        !done) {
      return done;
    }
  }
  return {};
}

Stored<Recollection> read_drive(const Database& database, std::span<const std::int64_t> parts) {
  Recollection drive;
  const std::string list = list_of(parts);
  std::int64_t first = 0;
  Stored<void> read = for_each_row(database,
                                   "SELECT keyframe, time_ns, x_m, y_m, heading_rad, travelled_m, step, lvm, structure "
                                   "FROM x_keyframes WHERE part IN " +
                                       list + " ORDER BY keyframe",
                                   [&](const Statement& row) -> Stored<void> {
                                     if (drive.keyframes.empty()) first = row.integer(0);
                                     const auto expected = first + static_cast<std::int64_t>(drive.keyframes.size());
                                     if (row.integer(0) == expected && read_keyframe(row, drive)) return {};
                                     return in_trouble(StoreTrouble::damaged,
                                                       "keyframe " + std::to_string(expected) + " cannot be read");
                                   });
  if (!read) return tl::unexpected<StoreError>(read.error());
  const auto count = static_cast<std::int64_t>(drive.keyframes.size());
  read = for_each_row(database,
                      "SELECT from_keyframe, to_keyframe, edge FROM x_loops WHERE part IN " + list +
                          " ORDER BY to_keyframe, from_keyframe",
                      [&](const Statement& row) -> Stored<void> {
                        const std::int64_t from = row.integer(0) - first, to = row.integer(1) - first;
                        if (from < 0 || from >= to || to >= count) return {};  // to a drive that is not among these
                        const std::optional<PoseEdge> edge =
                            edge_in(row.blob(2), static_cast<std::size_t>(from), static_cast<std::size_t>(to));
                        if (!edge) return in_trouble(StoreTrouble::damaged, "a loop cannot be read");
                        drive.graph.loops.push_back({*edge, true});
                        return {};
                      });
  if (!read) return tl::unexpected<StoreError>(read.error());
  return drive;
}

Stored<DriveReach> reach_of_drive(const Database& database, std::span<const std::int64_t> parts,
                                  const Eigen::Vector2d& place_map) {
  Stored<Statement> query = database.prepare(
      "SELECT count(*), min((x_m - ?1) * (x_m - ?1) + (y_m - ?2) * (y_m - ?2)) FROM x_keyframes WHERE part IN " +
      list_of(parts));
  if (!query) return tl::unexpected<StoreError>(query.error());
  query->bind_all(place_map.x(), place_map.y());
  if (const Stored<bool> row = query->step(); !row) return tl::unexpected<StoreError>(row.error());
  return DriveReach{query->integer(0), std::sqrt(query->real(1))};
}

}  // namespace roadvec
