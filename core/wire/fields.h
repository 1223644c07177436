#pragma once

#include <concepts>
#include <type_traits>

#include "core/wire/messages.h"

/// The fields of every message of roadvec.proto: number and member, once. `Walk` is the encoder or the decoder of
/// codec.cpp; both walk the same lists, so that they cannot disagree. Private to core/wire.
namespace roadvec::wire {

template <class M, class... T>
concept Is = (std::same_as<std::remove_const_t<M>, T> || ...);

template <class Walk, Is<Hello> M>
void fields(Walk& f, M& m) {
  f.number(1, m.proto_major), f.number(2, m.proto_minor), f.text(3, m.client_name), f.number(4, m.capabilities);
}
template <class Walk, Is<Anchor> M>
void fields(Walk& f, M& m) {
  f.real(1, m.latitude_deg), f.real(2, m.longitude_deg), f.real(3, m.height_m), f.real(4, m.yaw_deg);
}
template <class Walk, Is<Pose2> M>
void fields(Walk& f, M& m) {
  f.real(1, m.x_m), f.real(2, m.y_m), f.real(3, m.theta_rad);
}
template <class Walk, Is<Welcome> M>
void fields(Walk& f, M& m) {
  f.number(1, m.proto_major), f.number(2, m.proto_minor), f.fixed(3, m.epoch), f.number(4, m.head_seq);
  f.number(5, m.oldest_seq), f.optional(6, m.anchor), f.message(7, m.T_map_odom), f.text(8, m.server_version);
  f.number(9, m.tile_size_mm);
}

template <class Walk, Is<TileKey> M>
void fields(Walk& f, M& m) {
  f.zigzag(1, m.ix), f.zigzag(2, m.iy);
}
template <class Walk, Is<Tile> M>
void fields(Walk& f, M& m) {
  f.message(1, m.key), f.number(2, m.revision), f.pieces(3, m.pieces, m.key);
}
template <class Walk, Is<TileDelta> M>
void fields(Walk& f, M& m) {
  f.message(1, m.key), f.number(2, m.revision), f.pieces(3, m.upserted, m.key), f.numbers(4, m.removed);
}
template <class Walk, Is<Lineage> M>
void fields(Walk& f, M& m) {
  f.number(1, m.retired), f.numbers(2, m.successors);
}
template <class Walk, Is<Area> M>
void fields(Walk& f, M& m) {
  f.zigzag(1, m.x_min_mm), f.zigzag(2, m.y_min_mm), f.zigzag(3, m.x_max_mm), f.zigzag(4, m.y_max_mm);
}
template <class Walk, Is<KnownTile> M>
void fields(Walk& f, M& m) {
  f.zigzag(1, m.key.ix), f.zigzag(2, m.key.iy), f.number(3, m.revision);
}
template <class Walk, Is<GetTiles> M>
void fields(Walk& f, M& m) {
  f.optional(1, m.area), f.real(2, m.around_vehicle_m), f.repeated(3, m.keys), f.repeated(4, m.known),
      f.fixed(5, m.known_epoch);
}
template <class Walk, Is<Tiles> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.as_of_seq), f.repeated(3, m.tiles), f.flag(4, m.more);
}

template <class Walk, Is<Resume> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.seq);
}
template <class Walk, Is<Subscribe> M>
void fields(Walk& f, M& m) {
  f.optional(1, m.area), f.optional(2, m.resume), f.repeated(3, m.known), f.fixed(4, m.known_epoch);
  f.real(5, m.max_rate_hz), f.flag(6, m.poses), f.flag(7, m.status);
}
template <class Walk, Is<SnapshotBegin> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.as_of_seq), f.message(3, m.T_map_odom), f.number(4, m.tile_count),
      f.flag(5, m.incremental);
}
template <class Walk, Is<SnapshotEnd> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.as_of_seq), f.message(3, m.T_map_odom);
}
template <class Walk, Is<Resumed> M>
void fields(Walk& f, M& m) {
  f.number(1, m.from_seq);
}
template <class Walk, Is<Delta> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.seq), f.fixed(3, m.time.ns), f.message(4, m.T_map_odom);
  f.repeated(5, m.tiles), f.repeated(6, m.lineage), f.flag(7, m.continued);
}
template <class Walk, Is<EpochChange> M>
void fields(Walk& f, M& m) {
  f.choice(1, m.reason, EpochChange::Reason::map_replaced), f.fixed(2, m.epoch_before), f.fixed(3, m.epoch),
      f.number(4, m.seq);
  f.fixed(5, m.time.ns), f.message(6, m.T_map_odom_before), f.message(7, m.T_map_odom_after);
}
template <class Walk, Is<Overrun> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.first_lost_seq), f.number(3, m.last_lost_seq), f.number(4, m.tile_count);
  f.optional(5, m.T_map_odom);
}
template <class Walk, Is<PoseCovariance> M>
void fields(Walk& f, M& m) {
  f.real(1, m(0, 0)), f.real(2, m(0, 1)), f.real(3, m(0, 2)), f.real(4, m(1, 1)), f.real(5, m(1, 2)),
      f.real(6, m(2, 2));
}
template <class Walk, Is<Pose> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.time.ns), f.fixed(2, m.epoch), f.message(3, m.T_map_vehicle), f.message(4, m.T_odom_vehicle);
  f.message(5, m.T_map_odom), f.message(6, m.covariance), f.real(7, m.speed_mps), f.real(8, m.yaw_rate_radps);
}
template <class Walk, Is<Heartbeat> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.epoch), f.number(2, m.head_seq);
}

template <class Walk, Is<Counter> M>
void fields(Walk& f, M& m) {
  f.text(1, m.name), f.number(2, m.value);
}
template <class Walk, Is<Gauge> M>
void fields(Walk& f, M& m) {
  f.text(1, m.name), f.real(2, m.value);
}
template <class Walk, Is<Timing> M>
void fields(Walk& f, M& m) {
  f.text(1, m.step), f.number(2, m.count), f.real(3, m.p50_us), f.real(4, m.p99_us), f.real(5, m.max_us);
  f.real(6, m.sum_us), f.numbers(7, m.at_most_counts);
}
template <class Walk, Is<Stage> M>
void fields(Walk& f, M& m) {
  f.text(1, m.name), f.text(2, m.state), f.repeated(3, m.counters), f.repeated(4, m.gauges), f.repeated(5, m.timings);
  f.text(6, m.detail);
}
template <class Walk, Is<Status> M>
void fields(Walk& f, M& m) {
  f.fixed(1, m.time.ns), f.text(2, m.server_version), f.text(3, m.state), f.text(4, m.not_growing_reason),
      f.fixed(5, m.epoch);
  f.number(6, m.head_seq), f.number(7, m.durable_seq), f.number(8, m.keyframe_count), f.number(9, m.loop_closure_count);
  f.number(10, m.line_count), f.number(11, m.tile_count), f.real(12, m.map_length_m), f.real(13, m.travelled_m);
  f.real(14, m.uptime_s), f.repeated(15, m.stages), f.optional(16, m.pose);
}

template <class Walk, Is<Bye> M>
void fields(Walk& f, M& m) {
  f.choice(1, m.reason, Bye::Reason::not_authorised), f.text(2, m.text);
}
template <class Walk, Is<Error> M>
void fields(Walk& f, M& m) {
  f.choice(1, m.code, Error::Code::invalid), f.text(2, m.text);
}
template <class Walk, Is<Ping, Pong> M>
void fields(Walk& f, M& m) {
  f.number(1, m.nonce);
}
template <class Walk, Is<Metrics, ImportMap> M>
void fields(Walk& f, M& m) {
  if constexpr (Is<M, Metrics>) f.text(1, m.text);
  if constexpr (Is<M, ImportMap>) f.text(1, m.path);
}
template <class Walk, Is<GetStatus, GetMetrics, Save, NewMap> M>
void fields(Walk&, M&) {}
template <class Walk, Is<Command> M>
void fields(Walk& f, M& m) {
  f.optional(1, m.save), f.optional(2, m.new_map), f.optional(3, m.import_map);
}
template <class Walk, Is<CommandResult> M>
void fields(Walk& f, M& m) {
  f.flag(1, m.done), f.text(2, m.text), f.number(3, m.durable_seq);
}

}  // namespace roadvec::wire
