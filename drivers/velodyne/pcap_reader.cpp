#include "drivers/velodyne/pcap_reader.h"

#include <algorithm>

namespace roadvec {

Expected<std::unique_ptr<PcapReader>> PcapReader::open(const std::filesystem::path& path,
                                                       const PcapReaderOptions& options, LidarCounters& counters) {
  Expected<CaptureFile> file = CaptureFile::open(path);
  if (!file) return tl::unexpected(file.error());
  return std::unique_ptr<PcapReader>(new PcapReader(std::move(*file), path.string(), options, counters));
}

PcapReader::PcapReader(CaptureFile file, std::string name, const PcapReaderOptions& options, LidarCounters& counters)
    : file_(std::move(file)),
      name_(std::move(name)),
      options_(options),
      counters_(counters),
      senders_(options.source_ipv4),
      packets_(kBatchPackets),
      positions_(kBatchPositions) {}

ReadResult PcapReader::read(std::span<const RawPacket>& batch, std::chrono::milliseconds) noexcept {
  packet_count_ = position_count_ = 0;
  while (packet_count_ < packets_.size() && position_count_ < positions_.size() && !finished_) {
    CaptureFile::Frame frame;
    const CaptureFile::Next next = file_.next(frame);
    if (next == CaptureFile::Next::frame) {
      take(frame);
    } else {
      finish(next);
    }
  }
  batch = {packets_.data(), packet_count_};
  return packet_count_ + position_count_ > 0 ? ReadResult::packets : finished_.value_or(ReadResult::quiet);
}

void PcapReader::finish(CaptureFile::Next how) noexcept {
  finished_ = how == CaptureFile::Next::failed ? ReadResult::failed : ReadResult::end;
  if (how == CaptureFile::Next::cut_off) warning_ = file_.problem();
  if (how == CaptureFile::Next::failed) error_ = file_.problem();
  if (finished_ == ReadResult::end && counters_.received.value() == 0) {
    error_ = nothing_found();
    finished_ = ReadResult::failed;
  }
}

std::string PcapReader::nothing_found() const {
  std::string text = name_ + ": no data packets" +
                     (options_.port == 0 ? "" : " to UDP port " + std::to_string(options_.port)) + ", but ";
  const auto count = [](std::uint64_t n, const char* what) { return std::to_string(n) + " " + what; };
  text += count(counters_.position_packets.value(), "position packets, ") +
          count(other_frame_count_, "other frames, ") + count(counters_.wrong_length.value(), "of another length, ") +
          count(counters_.foreign_source.value(), "of another sender, ") +
          count(counters_.fragments.value(), "IP fragments, ") +
          count(counters_.cut_short.value(), "cut short by a snap length of ") + std::to_string(file_.snap_bytes());
  if (counters_.cut_short.value() > 0) return text + "; capture whole packets (tcpdump -s 0)";
  if (counters_.fragments.value() > 0) return text + "; fragments are not put together: raise the network's MTU";
  return text + "; is the port right?";
}

void PcapReader::take(const CaptureFile::Frame& frame) noexcept {
  const CapturedFrame parsed = parse_frame(file_.link(), frame.bytes);
  if (parsed.fragment) return counters_.fragments.add();
  if (!parsed.datagram) return void(++other_frame_count_);
  const UdpDatagram& datagram = *parsed.datagram;
  const bool for_us = options_.port == 0 ? datagram.length == kPacketBytes : datagram.destination_port == options_.port;
  const bool position = options_.position_port != 0 && datagram.destination_port == options_.position_port;
  if (for_us) return take_data(datagram, frame.time);
  if (position) return take_position(datagram, frame.time);
  ++other_frame_count_;
}

void PcapReader::take_data(const UdpDatagram& datagram, SensorTime arrived) noexcept {
  if (!senders_.ours(datagram.source_ipv4) && options_.source_ipv4) return counters_.foreign_source.add();
  if (datagram.length != kPacketBytes) return counters_.wrong_length.add();
  if (datagram.payload.size() != kPacketBytes) return counters_.cut_short.add();
  if (!senders_.take(datagram.source_ipv4)) {
    error_ = name_ + ": more than one sensor sends to the port: " + senders_.list() +
             "; set lidar.source_address to the one that is meant";
    finished_ = ReadResult::failed;
    return counters_.foreign_source.add();
  }
  counters_.received.add();
  RawPacket& packet = packets_[packet_count_++];
  packet.arrived = arrived;
  packet.source_ipv4 = datagram.source_ipv4;
  std::copy(datagram.payload.begin(), datagram.payload.end(), packet.bytes.begin());
}

void PcapReader::take_position(const UdpDatagram& datagram, SensorTime arrived) noexcept {
  if (!senders_.ours(datagram.source_ipv4)) return counters_.foreign_source.add();
  if (datagram.payload.size() != kPositionPacketBytes || datagram.length != kPositionPacketBytes)
    return counters_.position_wrong_length.add();
  counters_.position_packets.add();
  RawPositionPacket& packet = positions_[position_count_++];
  packet.arrived = arrived;
  packet.source_ipv4 = datagram.source_ipv4;
  std::copy(datagram.payload.begin(), datagram.payload.end(), packet.bytes.begin());
}

}  // namespace roadvec
