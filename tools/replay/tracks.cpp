#include "tools/replay/tracks.h"

#include <algorithm>
#include <cstdio>

#include "drivers/can/candump_line.h"
#include "drivers/recording/log_stamp.h"
#include "drivers/velodyne/packet.h"

namespace roadvec {
namespace {

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

Expected<void> reopen(const std::string& path, std::optional<RecordingFile>& file) {
  auto opened = RecordingFile::open(path);
  if (!opened) return tl::make_unexpected(opened.error());
  file.emplace(std::move(*opened));
  return {};
}

}  // namespace

LidarTrack::LidarTrack(Source source, std::string destination, UdpOutput data, std::optional<UdpOutput> position)
    : Track("lidar"),
      source_(std::move(source)),
      destination_(std::move(destination)),
      data_(std::move(data)),
      position_(std::move(position)) {}

Expected<void> LidarTrack::rewind() {
  Expected<CaptureFile> file = CaptureFile::open(source_.pcap);
  if (!file) return tl::make_unexpected(file.error());
  file_.emplace(std::move(*file));
  return {};
}

std::optional<SensorTime> LidarTrack::next() {
  CaptureFile::Frame frame;
  CaptureFile::Next next{};
  while ((next = file_->next(frame)) == CaptureFile::Next::frame) {
    if (take(frame.bytes)) return frame.time;
    count_skipped();
  }
  if (next != CaptureFile::Next::end) warn(file_->problem());
  return std::nullopt;
}

/// False: not from this sensor, or not whole.
bool LidarTrack::take(std::span<const std::uint8_t> frame) {
  const CapturedFrame captured = parse_frame(file_->link(), frame);
  if (!captured.datagram) return false;
  const UdpDatagram& datagram = *captured.datagram;
  is_position_ = datagram.destination_port == kPositionPort && source_.port != kPositionPort;
  if (!is_position_ && datagram.destination_port != source_.port) return false;
  if (is_position_ && !position_) return false;
  if (source_.sender_ipv4 && datagram.source_ipv4 != *source_.sender_ipv4) return false;
  payload_ = datagram.payload;
  return datagram.payload.size() == datagram.length;
}

void LidarTrack::send(const SendMoment&) { count((is_position_ ? *position_ : data_).send(payload_), payload_.size()); }

CanTrack::CanTrack(std::string log, std::string destination, std::optional<CanOutput> interface,
                   std::optional<PipeOutput> pipe)
    : Track("can"),
      log_(std::move(log)),
      destination_(std::move(destination)),
      interface_(std::move(interface)),
      pipe_(std::move(pipe)) {}

Expected<void> CanTrack::rewind() { return reopen(log_, file_); }

std::optional<SensorTime> CanTrack::next() {
  while (const auto text = file_->next_line()) {
    const CandumpLine parsed = parse_candump_line(*text);
    if (parsed.kind == CandumpKind::blank) continue;
    std::string_view behind_stamp = *text;
    const bool has_stamp = take_log_stamp(behind_stamp).has_value();
    // Error frames tell what a controller has seen; no controller sends them.
    if (parsed.kind != CandumpKind::frame || !has_stamp || parsed.frame.error) {
      count_skipped();
      continue;
    }
    frame_ = parsed.frame;
    line_ = behind_stamp;
    return frame_.time;
  }
  if (file_->failed()) warn(log_ + ": cannot be read on; played up to there");
  return std::nullopt;
}

void CanTrack::send(const SendMoment& moment) {
  if (interface_) count(interface_->send(frame_, moment), frame_.length);
  if (!pipe_) return;
  std::array<char, 40> stamp{};
  const auto wall_us = moment.wall.ns / 1000;
  std::snprintf(stamp.data(), stamp.size(), "(%lld.%06lld) ", static_cast<long long>(wall_us / 1'000'000),
                static_cast<long long>(wall_us % 1'000'000));
  const std::string stamped = stamp.data() + line_ + "\n";
  count(pipe_->send(bytes_of(stamped), moment), stamped.size());
}

ImuTrack::ImuTrack(std::string log, std::string destination, std::optional<PtyOutput> terminal,
                   std::optional<UdpOutput> udp)
    : Track("imu"),
      log_(std::move(log)),
      destination_(std::move(destination)),
      terminal_(std::move(terminal)),
      udp_(std::move(udp)) {}

Expected<void> ImuTrack::rewind() { return reopen(log_, file_); }

std::optional<SensorTime> ImuTrack::next() {
  while (const auto text = file_->next_line()) {
    if (text->find_first_not_of(" \t\r") == std::string_view::npos) continue;
    if (const auto line = parse_imu_log_line(*text, bytes_)) {
      byte_count_ = line->byte_count;
      return line->time;
    }
    count_skipped();
  }
  if (file_->failed()) warn(log_ + ": cannot be read on; played up to there");
  return std::nullopt;
}

void ImuTrack::send(const SendMoment& moment) {
  const auto bytes = std::span<const std::uint8_t>(bytes_).first(byte_count_);
  if (terminal_) count(terminal_->send(bytes, moment), bytes.size());
  if (udp_) count(udp_->send(bytes), bytes.size());
}

}  // namespace roadvec
