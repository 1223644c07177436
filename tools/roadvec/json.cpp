#include "tools/roadvec/json.h"

#include "daemon/server/map_files.h"
#include "daemon/server/text_writer.h"

namespace roadvec {
namespace {

/// Collects the members of one object.
class Object {
 public:
  Object& raw(std::string_view name, std::string_view value) {
    text_ += text_.size() > 1 ? "," : "";
    text_ += json_text(name);
    text_ += ":";
    text_ += value;
    return *this;
  }
  Object& text(std::string_view name, std::string_view value) { return raw(name, json_text(value)); }
  Object& number(std::string_view name, double value, int digits) { return raw(name, decimal(value, digits)); }
  template <class Integer>
  Object& count(std::string_view name, Integer value) {
    return raw(name, std::to_string(value));
  }
  [[nodiscard]] std::string done() const { return text_ + "}"; }

 private:
  std::string text_ = "{";
};

template <class Values, class ToJson>
std::string array(const Values& values, ToJson&& to_json) {
  std::string text = "[";
  for (const auto& value : values) {
    if (text.size() > 1) text += ",";
    text += to_json(value);
  }
  return text + "]";
}

std::string integer(std::uint64_t value) { return std::to_string(value); }

std::string part_json(const TilePiece& piece) {
  const LineAttributes& a = piece.attributes;
  const auto vertex = [](const TileVertex& v) {
    return "[" + std::to_string(v.x_mm) + "," + std::to_string(v.y_mm) + "," + std::to_string(v.z_mm) + "]";
  };
  const auto sigma = [](const TileVertex& v) { return std::to_string(v.sigma_across_mm); };
  return Object()
      .count("line_id", piece.line)
      .count("revision", piece.revision)
      .text("kind", name_of(a.kind))
      .text("first_end", name_of(a.first_end))
      .text("last_end", name_of(a.last_end))
      .count("height_mm", mm_from_m(a.height_m))
      .number("existence", a.existence, 3)
      .count("observation_count", a.observation_count)
      .raw("first_seen_s", seconds_text(piece.first_seen.ns))
      .raw("last_seen_s", seconds_text(piece.last_seen.ns))
      .count("first_vertex", piece.first_vertex)
      .count("line_vertex_count", piece.line_vertex_count)
      .raw("vertices_mm", array(piece.vertices, vertex))
      .raw("sigma_across_mm", array(piece.vertices, sigma))
      .done();
}

std::string part_json(const TileDelta& delta) {
  return Object()
      .count("ix", delta.key.ix)
      .count("iy", delta.key.iy)
      .count("revision", delta.revision)
      .raw("upserted", array(delta.upserted, [](const TilePiece& piece) { return part_json(piece); }))
      .raw("removed_line_ids", array(delta.removed, integer))
      .done();
}

std::string part_json(const Pose2& pose) {
  return Object().number("x_m", pose.x_m, 4).number("y_m", pose.y_m, 4).number("theta_rad", pose.theta_rad, 6).done();
}

std::string part_json(const wire::Pose& pose) {
  const PoseCovariance& c = pose.covariance;
  return Object()
      .raw("time_s", seconds_text(pose.time.ns))
      .count("epoch", pose.epoch)
      .raw("T_map_vehicle", part_json(pose.T_map_vehicle))
      .raw("T_odom_vehicle", part_json(pose.T_odom_vehicle))
      .raw("T_map_odom", part_json(pose.T_map_odom))
      .raw("covariance", Object()
                             .number("xx", c(0, 0), 9)
                             .number("xy", c(0, 1), 9)
                             .number("xt", c(0, 2), 9)
                             .number("yy", c(1, 1), 9)
                             .number("yt", c(1, 2), 9)
                             .number("tt", c(2, 2), 9)
                             .done())
      .number("speed_mps", pose.speed_mps, 3)
      .number("yaw_rate_radps", pose.yaw_rate_radps, 5)
      .done();
}

std::string part_json(const wire::Stage& stage) {
  Object counters, gauges;
  for (const wire::Counter& counter : stage.counters) counters.count(counter.name, counter.value);
  for (const wire::Gauge& gauge : stage.gauges) gauges.number(gauge.name, gauge.value, 6);
  const auto timing = [](const wire::Timing& t) {
    return Object()
        .text("step", t.step)
        .count("count", t.count)
        .number("p50_us", t.p50_us, 1)
        .number("p99_us", t.p99_us, 1)
        .number("max_us", t.max_us, 1)
        .number("sum_us", t.sum_us, 1)
        .raw("at_most_counts", array(t.at_most_counts, integer))
        .done();
  };
  return Object()
      .text("name", stage.name)
      .text("state", stage.state)
      .text("detail", stage.detail)
      .raw("counters", counters.done())
      .raw("gauges", gauges.done())
      .raw("timings", array(stage.timings, timing))
      .done();
}

}  // namespace

std::string json_of(const Tile& tile) {
  return Object()
      .count("ix", tile.key.ix)
      .count("iy", tile.key.iy)
      .count("revision", tile.revision)
      .raw("pieces", array(tile.pieces, [](const TilePiece& piece) { return part_json(piece); }))
      .done();
}

std::string json_of(const wire::Status& status) {
  return Object()
      .text("type", "status")
      .text("state", status.state)
      .text("not_growing_reason", status.not_growing_reason)
      .text("server_version", status.server_version)
      .raw("time_s", seconds_text(status.time.ns))
      .count("epoch", status.epoch)
      .count("head_seq", status.head_seq)
      .count("durable_seq", status.durable_seq)
      .count("keyframe_count", status.keyframe_count)
      .count("loop_closure_count", status.loop_closure_count)
      .count("line_count", status.line_count)
      .count("tile_count", status.tile_count)
      .number("map_length_m", status.map_length_m, 1)
      .number("travelled_m", status.travelled_m, 1)
      .number("uptime_s", status.uptime_s, 1)
      .raw("pose", status.pose ? part_json(*status.pose) : "null")
      .raw("stages", array(status.stages, [](const wire::Stage& stage) { return part_json(stage); }))
      .done();
}

std::string json_of(const wire::Delta& delta) {
  const auto lineage = [](const Lineage& l) {
    return Object().count("retired_line_id", l.retired).raw("successor_line_ids", array(l.successors, integer)).done();
  };
  return Object()
      .text("type", "delta")
      .count("epoch", delta.epoch)
      .count("seq", delta.seq)
      .raw("time_s", seconds_text(delta.time.ns))
      .raw("T_map_odom", part_json(delta.T_map_odom))
      .raw("tiles", array(delta.tiles, [](const TileDelta& tile) { return part_json(tile); }))
      .raw("lineage", array(delta.lineage, lineage))
      .raw("continued", delta.continued ? "true" : "false")
      .done();
}

std::string json_of(const wire::EpochChange& change) {
  return Object()
      .text("type", "epoch_change")
      .text("reason", change.reason == wire::EpochChange::Reason::loop_closure ? "loop_closure" : "map_replaced")
      .count("epoch_before", change.epoch_before)
      .count("epoch", change.epoch)
      .count("seq", change.seq)
      .raw("time_s", seconds_text(change.time.ns))
      .raw("T_map_odom_before", part_json(change.T_map_odom_before))
      .raw("T_map_odom_after", part_json(change.T_map_odom_after))
      .done();
}

std::string json_of(const wire::CommandResult& result) {
  return Object()
      .text("type", "command_result")
      .text("text", result.text)
      .count("durable_seq", result.durable_seq)
      .done();
}

std::string json_of(const wire::Pose& pose) { return R"({"type":"pose",)" + part_json(pose).substr(1); }

}  // namespace roadvec
